/* Replacement of bind() for libraries that listen on all network interfaces and have no option to change that: the
 * addresses 0.0.0.0 and :: become the loopback address. */
#ifndef HRIC_CONTROL_LOOPBACK_H
#define HRIC_CONTROL_LOOPBACK_H

#ifndef _GNU_SOURCE
#define _GNU_SOURCE /* dladdr */
#endif

#include <dlfcn.h>
#include <netinet/in.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

static inline int hric_bind_to_loopback(int fd, const struct sockaddr* address, socklen_t size)
{
  union
  {
    struct sockaddr_in v4;
    struct sockaddr_in6 v6;
  } here;
  if (size <= sizeof here)
  {
    memcpy(&here, address, size);
    if (address->sa_family == AF_INET && size >= sizeof here.v4 && here.v4.sin_addr.s_addr == htonl(INADDR_ANY))
    {
      here.v4.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      return (int)syscall(SYS_bind, fd, &here, size);
    }
    if (address->sa_family == AF_INET6 && size >= sizeof here.v6 && IN6_IS_ADDR_UNSPECIFIED(&here.v6.sin6_addr))
    {
      here.v6.sin6_addr = in6addr_loopback;
      return (int)syscall(SYS_bind, fd, &here, size);
    }
  }
  return (int)syscall(SYS_bind, fd, address, size);
}

/* True if ROS_HOSTNAME, or without it ROS_IP, is a loopback address: then no other machine takes part in ROS. */
static inline int hric_ros_is_local(void)
{
  const char *name = getenv("ROS_HOSTNAME"), *host = name != NULL ? name : getenv("ROS_IP");
  return host != NULL && (strcmp(host, "localhost") == 0 || strcmp(host, "::1") == 0 || strncmp(host, "127.", 4) == 0);
}

/* bind() for roscpp, whose XML-RPC server listens on all interfaces whatever ROS_IP says (that of rospy obeys ROS_IP).
 * caller: return address of the call; calls from libraries other than roscpp and xmlrpcpp are not changed. */
static inline int hric_bind_of_ros(int fd, const struct sockaddr* address, socklen_t size, void* caller)
{
  Dl_info library;
  if (hric_ros_is_local() && dladdr(caller, &library) != 0 && library.dli_fname != NULL &&
      (strstr(library.dli_fname, "libxmlrpcpp") != NULL || strstr(library.dli_fname, "libroscpp") != NULL))
    return hric_bind_to_loopback(fd, address, size);
  return (int)syscall(SYS_bind, fd, address, size);
}

#endif
