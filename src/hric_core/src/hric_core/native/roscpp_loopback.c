/* Library to preload into other projects' roscpp programs, such as rosout, so that they listen on loopback only: see
 * hric_core/loopback.h. */
#define _GNU_SOURCE /* NOLINT(bugprone-reserved-identifier): of the C library */
#include "hric_core/loopback.h"

__attribute__((visibility("default"))) int bind(int fd, const struct sockaddr *address, socklen_t size)
{
    return hric_bind_of_ros(fd, address, size, __builtin_return_address(0));
}
