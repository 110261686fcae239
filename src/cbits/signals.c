/* GHC's installHandler knows the handlers that it has installed itself, but not what the
   program that started this one has set: nohup ignores SIGHUP so. */

#ifndef _WIN32
#include <signal.h>

int behavior_lang_ignores(int signal)
{
    struct sigaction now;
    return sigaction(signal, 0, &now) == 0 && now.sa_handler == SIG_IGN;
}
#endif
