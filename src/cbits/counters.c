/* Counters that many threads change at the same time, and that almost every operation reads:
   in C a read is one instruction; with a Haskell reference it takes one to three jumps. */

#include <HsFFI.h>

HsInt behavior_lang_threads = 0;
HsInt behavior_lang_simulations = 0;
HsInt behavior_lang_traces = 0;

void behavior_lang_add(HsInt *counter, HsInt n)
{
    __atomic_fetch_add(counter, n, __ATOMIC_SEQ_CST);
}
