// This bind() of the program overrides that of the C library.
#include <hric_core/loopback.h>

extern "C" int bind(int fd, const sockaddr* address, socklen_t size) noexcept
{
  return hric_bind_of_ros(fd, address, size, __builtin_return_address(0));
}
