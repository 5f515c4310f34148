// Preloaded into a command: calls on files below some folders fail, or end the process, from the nth on.
//
// FAULT_UNDER: folders, separated by colons.   FAULT_CALL: open, read or write.   FAULT_NTH: first call that fails, from 1 on.
// FAULT_ERRNO: what it fails with; 0: the process is killed.   FAULT_HIT: file that is made with the first failure.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

static int calls;

static int below(const char* path)
{
  char whole[4096];
  const char* folders = getenv("FAULT_UNDER");
  if (!path || !folders)
    return 0;
  if (path[0] != '/')
  {
    if (!getcwd(whole, sizeof whole - strlen(path) - 2))
      return 0;
    strcat(strcat(whole, "/"), path);
    path = whole;
  }
  while (*folders)
  {
    const size_t length = strcspn(folders, ":");
    if (length && !strncmp(path, folders, length) && (path[length] == '/' || !path[length]))
      return 1;
    folders += length + (folders[length] == ':');
  }
  return 0;
}

static int fails(const char* call, const char* path)
{
  const char* failing = getenv("FAULT_CALL");
  if (!failing || strcmp(failing, call) || !below(path) || __sync_add_and_fetch(&calls, 1) < atoi(getenv("FAULT_NTH")))
    return 0;
  const char* hit = getenv("FAULT_HIT");
  if (hit)
    syscall(SYS_close, syscall(SYS_openat, AT_FDCWD, hit, O_CREAT | O_WRONLY, 0644));
  errno = atoi(getenv("FAULT_ERRNO"));
  if (!errno)
    syscall(SYS_kill, getpid(), SIGKILL);
  return 1;
}

static int fails_at(const char* call, int file)
{
  char link[32], path[4096];
  const char* failing = getenv("FAULT_CALL");
  if (!failing || strcmp(failing, call))
    return 0;
  snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  const ssize_t length = readlink(link, path, sizeof path - 1);
  if (length < 0 || path[0] != '/')  // a pipe or a socket
    return 0;
  path[length] = 0;
  return fails(call, path);
}

#define REAL(name) __typeof__(&name) real = (__typeof__(&name))dlsym(RTLD_NEXT, #name)
#define MODE                                                                                                                               \
  va_list list;                                                                                                                            \
  va_start(list, flags);                                                                                                                   \
  const mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(list, mode_t) : 0;                                                            \
  va_end(list)
#define OPEN(name)                                                                                                                         \
  int name(const char* path, int flags, ...)                                                                                               \
  {                                                                                                                                        \
    MODE;                                                                                                                                  \
    REAL(name);                                                                                                                            \
    return fails("open", path) ? -1 : real(path, flags, mode);                                                                             \
  }
#define OPENAT(name)                                                                                                                       \
  int name(int folder, const char* path, int flags, ...)                                                                                   \
  {                                                                                                                                        \
    MODE;                                                                                                                                  \
    REAL(name);                                                                                                                            \
    return fails("open", path) ? -1 : real(folder, path, flags, mode);                                                                     \
  }
#define FOPEN(name)                                                                                                                        \
  FILE* name(const char* path, const char* mode)                                                                                           \
  {                                                                                                                                        \
    REAL(name);                                                                                                                            \
    return fails("open", path) ? NULL : real(path, mode);                                                                                  \
  }

OPEN(open)
OPEN(open64)
OPENAT(openat)
OPENAT(openat64)
FOPEN(fopen)
FOPEN(fopen64)

int mkdir(const char* path, mode_t mode)
{
  REAL(mkdir);
  return fails("write", path) ? -1 : real(path, mode);
}

ssize_t read(int file, void* buffer, size_t size)
{
  REAL(read);
  return fails_at("read", file) ? -1 : real(file, buffer, size);
}

ssize_t pread64(int file, void* buffer, size_t size, off64_t offset)
{
  REAL(pread64);
  return fails_at("read", file) ? -1 : real(file, buffer, size, offset);
}

size_t fread(void* buffer, size_t size, size_t count, FILE* file)
{
  REAL(fread);
  return fails_at("read", fileno(file)) ? 0 : real(buffer, size, count, file);
}

ssize_t write(int file, const void* buffer, size_t size)
{
  REAL(write);
  return fails_at("write", file) ? -1 : real(file, buffer, size);
}

ssize_t pwrite64(int file, const void* buffer, size_t size, off64_t offset)
{
  REAL(pwrite64);
  return fails_at("write", file) ? -1 : real(file, buffer, size, offset);
}

ssize_t writev(int file, const struct iovec* parts, int count)
{
  REAL(writev);
  return fails_at("write", file) ? -1 : real(file, parts, count);
}

size_t fwrite(const void* buffer, size_t size, size_t count, FILE* file)
{
  REAL(fwrite);
  return fails_at("write", fileno(file)) ? 0 : real(buffer, size, count, file);
}
