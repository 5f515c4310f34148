/* For libraries that listen on all interfaces and have no option for it: a bind() that takes loopback in their place. */
#ifndef HRIC_CONTROL_LOOPBACK_H
#define HRIC_CONTROL_LOOPBACK_H

#include <netinet/in.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

static inline int hric_bind_to_loopback(int fd, const struct sockaddr *address, socklen_t size)
{
    union {
        struct sockaddr_in v4;
        struct sockaddr_in6 v6;
    } here;
    if (size <= sizeof here) {
        memcpy(&here, address, size);
        if (address->sa_family == AF_INET && size >= sizeof here.v4 && here.v4.sin_addr.s_addr == htonl(INADDR_ANY)) {
            here.v4.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
            return (int)syscall(SYS_bind, fd, &here, size);
        }
        if (address->sa_family == AF_INET6 && size >= sizeof here.v6 && IN6_IS_ADDR_UNSPECIFIED(&here.v6.sin6_addr)) {
            here.v6.sin6_addr = in6addr_loopback;
            return (int)syscall(SYS_bind, fd, &here, size);
        }
    }
    return (int)syscall(SYS_bind, fd, address, size);
}

#endif
