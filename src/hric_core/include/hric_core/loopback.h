/* For libraries that listen on all interfaces and have no option for it: a bind() that takes loopback in their place.
 */
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

/* True if ROS is to stay on this machine, by what rospy and roscpp go by. */
static inline int hric_ros_is_local(void)
{
  const char *name = getenv("ROS_HOSTNAME"), *host = name != NULL ? name : getenv("ROS_IP");
  return host != NULL && (strcmp(host, "localhost") == 0 || strcmp(host, "::1") == 0 || strncmp(host, "127.", 4) == 0);
}

/* bind() as roscpp should call it: its XML-RPC server takes all interfaces whatever ROS_IP says, while rospy's obeys.
 * caller: return address of the call; what other libraries bind is left alone. */
static inline int hric_bind_of_ros(int fd, const struct sockaddr* address, socklen_t size, void* caller)
{
  Dl_info library;
  if (hric_ros_is_local() && dladdr(caller, &library) != 0 && library.dli_fname != NULL &&
      (strstr(library.dli_fname, "libxmlrpcpp") != NULL || strstr(library.dli_fname, "libroscpp") != NULL))
    return hric_bind_to_loopback(fd, address, size);
  return (int)syscall(SYS_bind, fd, address, size);
}

#endif
