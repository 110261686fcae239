/* What GHC's handlers of signals do not do. */

#ifndef _WIN32
#include <signal.h>
#include <time.h>
#include <unistd.h>

/* GHC's installHandler knows the handlers that it has installed itself, but not what the
   program that started this one has set: nohup ignores SIGHUP so. */
int behavior_lang_ignores(int signal)
{
    struct sigaction now;
    return sigaction(signal, 0, &now) == 0 && now.sa_handler == SIG_IGN;
}

/* GHC calls a handler in a Haskell thread. While a loop that never allocates keeps the
   capabilities, no thread runs, and no handler. So this one comes first: where the signal before
   has not been answered for two seconds, the next SIGINT or SIGTERM ends the process. */
static struct sigaction handlers_of_ghc[NSIG];
static long unanswered_since = 0; /* in seconds; 0 if each signal has been answered */

static const char problem[] =
    "runBehavior: no Haskell thread has run since the last signal. Does a loop never allocate\n"
    "(compile it with -fno-omit-yields), or an unsafe foreign call not return?\n";

/* Whether no run is there, and the signal has its default effect: at once, because the program
   may end before GHC calls a handler. */
static int at_rest[NSIG];

static void end_by(int signal)
{
    struct sigaction standard = {.sa_handler = SIG_DFL};
    sigaction(signal, &standard, 0);
    raise(signal);
}

static void on_signal(int signal, siginfo_t *info, void *context)
{
    struct timespec t;
    long before = 0;
    int first;
    clock_gettime(CLOCK_MONOTONIC, &t);
    first = __atomic_compare_exchange_n(
        &unanswered_since, &before, t.tv_sec + 1, 0, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST);
    /* (In this order: the thread that sets at_rest reads unanswered_since afterwards.) */
    if (__atomic_load_n(&at_rest[signal], __ATOMIC_SEQ_CST)) {
        end_by(signal);
    } else if (!first && signal != SIGHUP && t.tv_sec + 1 - before >= 2) {
        ssize_t written = write(STDERR_FILENO, problem, sizeof problem - 1);
        (void)written;
        end_by(signal);
    } else {
        handlers_of_ghc[signal].sa_sigaction(signal, info, context);
    }
}

/* To be called when GHC has installed a handler for the signal. */
void behavior_lang_watch(int signal)
{
    struct sigaction ours;
    __atomic_store_n(&at_rest[signal], 0, __ATOMIC_SEQ_CST);
    sigaction(signal, 0, &ours);
    if ((ours.sa_flags & SA_SIGINFO) && ours.sa_sigaction != on_signal) {
        handlers_of_ghc[signal] = ours;
        ours.sa_sigaction = on_signal;
        sigaction(signal, &ours, 0);
    }
}

/* To be called when the last run has ended, if the default was installed before the first. */
void behavior_lang_rest(int signal)
{
    __atomic_store_n(&at_rest[signal], 1, __ATOMIC_SEQ_CST);
}

/* Whether the Haskell handler of a signal has yet to be called. */
int behavior_lang_unanswered(void)
{
    return __atomic_load_n(&unanswered_since, __ATOMIC_SEQ_CST) != 0;
}

/* To be called by the Haskell handler. */
void behavior_lang_answer(void)
{
    __atomic_store_n(&unanswered_since, 0, __ATOMIC_SEQ_CST);
}
#endif
