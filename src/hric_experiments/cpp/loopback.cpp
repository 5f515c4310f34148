// Override bind() of the C library, so that ROS sockets listen on the loopback interface if ROS_IP or ROS_HOSTNAME is
// there.
#include <hric_core/loopback.h>

extern "C" int bind(int fd, const sockaddr* address, socklen_t size) noexcept
{
  return hric_bind_of_ros(fd, address, size, __builtin_return_address(0));
}
