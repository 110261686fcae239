/* Numbers that many threads change at once, and that almost every operation looks at: here
   that is one instruction, where a reference of Haskell's is a jump or three. */

#include <HsFFI.h>

HsInt behavior_lang_threads = 0;
HsInt behavior_lang_simulations = 0;
HsInt behavior_lang_sinks = 0;

void behavior_lang_add(HsInt *counter, HsInt n)
{
    __atomic_fetch_add(counter, n, __ATOMIC_SEQ_CST);
}
