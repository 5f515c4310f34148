// roscpp's XML-RPC server listens on all interfaces, whatever ROS_IP and ROS_HOSTNAME say: on loopback where they say
// so, as rospy does. The program's own bind() comes before that of the C library.
#include <cstdlib>
#include <cstring>

#include <hric_control/loopback.h>

namespace
{

bool isLoopback(const char* host)
{
  return !std::strcmp(host, "localhost") || !std::strcmp(host, "::1") || !std::strncmp(host, "127.", 4);
}

}  // namespace

extern "C" int bind(int fd, const sockaddr* address, socklen_t size) noexcept
{
  const char* name = std::getenv("ROS_HOSTNAME");
  const char* host = name != nullptr ? name : std::getenv("ROS_IP");
  if (host != nullptr && isLoopback(host))
    return hric_bind_to_loopback(fd, address, size);
  return static_cast<int>(syscall(SYS_bind, fd, address, size));
}
