/* A program whose standard streams are closed (behavior-trace ... >&-). */

#ifndef _WIN32
#include <fcntl.h>
#include <unistd.h>

/* GHC's runtime opens its epoll and its timer at the lowest descriptors that are free. If the timer were the standard
   output, a flush would wait for ever until the timer can be written. So before the runtime starts, what is closed is
   occupied, and open only for what it is not used for: then a read or write fails with EBADF, as if it were closed.
   (The lower ones are occupied, so open returns this one.) */
__attribute__((constructor)) static void occupy_standard_streams(void)
{
    int stream;
    for (stream = STDIN_FILENO; stream <= STDERR_FILENO; stream++)
        if (fcntl(stream, F_GETFD) == -1)
            (void)open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY);
}
#endif
