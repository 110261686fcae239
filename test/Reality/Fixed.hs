-- |
-- Programs with several threads whose outcome GHC determines: it is the same in every real
-- run, and must be the same in every simulated run.
--
-- Each program starts a target, and threads that throw to it; gates determine the order.
module Reality.Fixed
  ( Fixed (..)
  , table
  ) where

import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
import Control.Exception
import Control.Monad (void)

import Behavior (Behavior, failWith, (?))
import Behavior.Internal.Seam.Runtime (atomically, checkpoint, interrupt, now)
import Behavior.Parallel (both, firstOf, parallel)
import Behavior.Signal (watching)
import qualified Behavior.Signal as Signal
import Control.Concurrent (myThreadId)
import Reality.Stage
import Support

-- | A program, and its outcome.
data Fixed = Fixed
  { title :: String
  , expected :: String
  , program :: IO String
  }

table :: [(String, [Fixed])]
table =
  [ ("The target", targets)
  , ("A pending exception", unmasking)
  , ("Of several pending exceptions", several)
  , ("An exception that is pending in a handler", handlers)
  , ("The sender", senders)
  , ("An exception that a thread throws to itself", itself)
  , ("An operator", operators)
  ]

-- | The target is masked uninterruptibly until a gate opens; meanwhile an exception is thrown
-- to it. The outcome consists of the target's log and how it ended.
pending :: Show a => (IO () -> (String -> IO ()) -> IO a) -> IO String
pending = pendingAll ["a"]

-- | The same with several exceptions, one after the other.
pendingAll :: Show a => [String] -> (IO () -> (String -> IO ()) -> IO a) -> IO String
pendingAll names target = do
  gate <- newGate
  logged <- newLog
  t <- thread "target" (framed (target (uninterruptibleMask_ (pass gate)) (note logged)))
  throwers <- traverse (throwsTo t) names
  open gate
  end <- endOf t
  mapM_ endOf throwers
  recorded <- notes logged
  pure (unwords (recorded ++ [end]))

-- | The action with a stack frame of its own. (If a mask is in tail position, and the caller's
-- frame is masked, GHC omits the unmask.)
framed :: IO a -> IO a
framed act = act `catch` \e -> throwIO (e :: SomeException)

-- | An exception is thrown to the target once that is blocked.
thrownTo :: Show a => ((String -> IO ()) -> IO a) -> IO String
thrownTo target = do
  logged <- newLog
  t <- thread "target" (target (note logged))
  w <- throwsTo t "a"
  end <- endOf t
  _ <- endOf w
  recorded <- notes logged
  pure (unwords (recorded ++ [end]))

targets :: [Fixed]
targets =
  [ Fixed "is interrupted where it is blocked" "threw a" $ thrownTo (const nothing)
  , Fixed "is interrupted where it is blocked, masked" "threw a" $ thrownTo (\_ -> mask_ nothing)
  , Fixed "is interrupted where it blocks while it acquires, and does not release" "threw a" $
      thrownTo (\record -> bracket nothing (\_ -> record "release") (\_ -> record "use"))
  , Fixed "that has ended receives nothing" "ended () ()" $ do
      t <- thread "target" (pure ())
      w <- throwsTo t "a"
      endOf t >>= \end -> endOf w >>= \end' -> pure (unwords ["ended", end, end'])
  , Fixed "that has not begun receives it before it blocks" "threw a ()" $ do
      t <- member "target" nothing
      w <- member "thrower" (interrupt (memberId t) (Cancel "a"))
      endOf t >>= \end -> endOf w >>= \end' -> pure (unwords [end, end'])
  , Fixed "that has not begun is interrupted by its parent" "threw a" $ do
      t <- member "target" (mask_ nothing)
      interrupt (memberId t) (Cancel "a")
      endOf t
  , Fixed "that is masked continues where it need not block" "1 2 threw a" $
      pending (\waits record -> mask_ (waits >> record "1" >> checkpoint >> record "2"))
  , Fixed "that is masked continues through an open gate" "1 threw a" $
      pending (\waits record -> newGate >>= \gate -> open gate >> mask_ (waits >> pass gate >> record "1"))
  , Fixed "that is masked receives it where it blocks next" "1 threw a" $
      pending (\waits record -> mask_ (waits >> record "1" >> nothing >> record "2"))
  , Fixed "that is masked uninterruptibly stays blocked" "1 2 threw a" $ do
      gate <- newGate
      pending $ \waits record -> do
        uninterruptibleMask_ $ do
          waits
          record "1"
          opener <- member "opener" (open gate)
          pass gate
          record "2"
          void (endOf opener)
  , Fixed "that ends masked by an exception of its own never receives it" "1 threw b" $
      pending (\waits record -> uninterruptibleMask_ (waits >> record "1" >> throwIO (Cancel "b") :: IO ()))
  , Fixed "has these masking states" states $ mask_ $ do
      logged <- newLog
      let record = getMaskingState >>= note logged . take 9 . show
      t <- thread "target" $ do
        record
        mask_ (record >> interruptible record >> uninterruptibleMask_ (record >> interruptible record) >> record)
        mask (\restore -> restore record >> mask (\restoreInner -> restoreInner record))
        uninterruptibleMask (\restore -> mask_ record >> restore record)
        throwIO (Fault "x") `catch` \(Fault _) -> record
        uninterruptibleMask_ (throwIO (Fault "x") `catch` \(Fault _) -> record)
        (throwIO (Fault "x") `onException` record) `catch` \(Fault _) -> interruptible record
        bracket_ record record record
        record
      _ <- endOf t
      unwords <$> notes logged
  ]
 where
  nothing = hang :: IO ()
  states =
    "Unmasked MaskedInt Unmasked MaskedUni MaskedUni MaskedInt Unmasked MaskedInt MaskedUni Unmasked"
      ++ " MaskedInt MaskedUni MaskedInt Unmasked MaskedInt Unmasked MaskedInt Unmasked"

unmasking :: [Fixed]
unmasking =
  [ Fixed "is raised at the unmask, though nothing follows" "threw a" $ pending const
  , Fixed "is raised at the unmask, and no result is returned" "threw a" $ pending (\waits _ -> "done" <$ waits)
  , Fixed "is raised at the unmask, before a checkpoint" "threw a" $
      pending (\waits _ -> waits >> checkpoint >> pure "done")
  , Fixed "is raised at the unmask, before the clock is read" "threw a" $ pending (\waits _ -> waits >> now)
  , Fixed "is raised at the unmask, before a transaction" "threw a" $ pending (\waits record -> waits >> record "1")
  , Fixed "is raised at the end of the outermost mask" "1 threw a" $
      pending (\waits record -> mask_ (mask_ (mask_ waits) >> record "1") >> record "2")
  , Fixed "is raised inside of a handler that was installed outside of the mask" "1 ()" $
      pending (\waits record -> waits `catch` \(Cancel _) -> record "1")
  , Fixed "is not raised inside of a handler that was installed in the mask" "threw a" $
      pending (\waits record -> mask_ (waits `catch` \(Cancel _) -> record "1"))
  , Fixed "runs a cleanup that was installed outside of the mask" "1 threw a" $
      pending (\waits record -> waits `finally` record "1")
  , Fixed "does not run a cleanup that was installed in the mask" "threw a" $
      pending (\waits record -> mask_ (waits `onException` record "1"))
  , Fixed "is raised at restore" "1 threw a" $
      pending (\waits record -> mask (\restore -> waits >> record "1" >> restore (pure ()) >> record "2"))
  , Fixed "is raised at restore, before the restored action" "threw a" $
      pending (\waits record -> mask (\restore -> waits >> restore (checkpoint >> record "1")))
  , Fixed "is raised at restore of the outer mask" "1 threw a" $
      pending (\waits record -> mask (\restore -> mask_ (waits >> record "1" >> restore (pure ()) >> record "2")))
  , Fixed "is not raised at restore of an inner mask" "1 2 threw a" $
      pending (\waits record -> mask_ (mask (\restore -> waits >> record "1" >> restore (pure ()) >> record "2")))
  , Fixed "is raised at restore of an uninterruptible mask" "1 threw a" $
      pending
        (\waits record -> uninterruptibleMask (\restore -> waits >> record "1" >> restore (pure ()) >> record "2"))
  , Fixed "is raised at restore of an uninterruptible mask in a mask only where the target blocks" "1 2 threw a" $
      pending $ \waits record ->
        mask_ $ uninterruptibleMask $ \restore ->
          waits >> restore (record "1") >> record "2" >> restore hang >> record "3"
  , Fixed "is raised by allowInterrupt" "1 threw a" $
      pending (\waits record -> mask_ (waits >> record "1" >> allowInterrupt >> record "2"))
  , Fixed "is not raised by allowInterrupt in an uninterruptible mask" "1 2 threw a" $
      pending (\waits record -> uninterruptibleMask_ (waits >> record "1" >> allowInterrupt >> record "2"))
  , Fixed "is raised by interruptible, before the interruptible action" "1 threw a" $
      pending (\waits record -> mask_ (waits >> record "1" >> interruptible (record "2") >> record "3"))
  , Fixed "is raised by interruptible while that blocks" "threw a" $
      thrownTo (\record -> mask_ (interruptible hang >> record "1"))
  , Fixed "is received once" "1 2 done" $
      pending $ \waits record ->
        mask_ ((waits >> allowInterrupt) `catch` (\(Cancel _) -> record "1") >> allowInterrupt >> record "2")
          >> checkpoint
          >> pure (Plain "done")
  ]

several :: [Fixed]
several =
  [ -- (GHC raises the last one first.)
    Fixed "the second is raised when the first is received" "b a ()" $
      pendingAll ["a", "b"] $ \waits record -> (waits `catch` recording record) `catch` recording record
  , Fixed "each restore raises one" "b 1 a 2 ()" $
      pendingAll ["a", "b"] $ \waits record -> mask $ \restore -> do
        waits
        restore (pure ()) `catch` recording record
        record "1"
        restore (pure ()) `catch` recording record
        record "2"
  , Fixed "the second is raised where the handler of the first blocks" "b threw a" $
      pendingAll ["a", "b"] (\waits record -> waits `catch` \e -> recording record e >> hang)
  , Fixed "the second is raised when the handler of the first returns" "b 1 threw a" $
      pendingAll ["a", "b"] (\waits record -> waits `catch` \e -> recording record e >> record "1")
  , Fixed "the second is not raised where the first ends the thread" "1 threw b" $
      pendingAll ["a", "b"] (\waits record -> waits `onException` record "1")
  , Fixed "one that was withdrawn is not raised" "c a ()" $ do
      gate <- newGate
      logged <- newLog
      t <- thread "target" $
        (uninterruptibleMask_ (pass gate) `catch` recording (note logged)) `catch` recording (note logged)
      a <- throwsTo t "a"
      b <- throwsTo t "b"
      c <- throwsTo t "c"
      interrupt (memberId b) (Cancel "stop")
      _ <- endOf b
      open gate
      end <- endOf t
      mapM_ endOf [a, c]
      (\recorded -> unwords (recorded ++ [end])) <$> notes logged
  ]

recording :: (String -> IO ()) -> Cancel -> IO ()
recording record (Cancel name) = record name

handlers :: [Fixed]
handlers =
  [ Fixed "is raised when the handler returns" "1 threw a" $
      pending (\waits record -> throwIO (Fault "x") `catch` \(Fault _) -> waits >> record "1")
  , Fixed "is raised before the action after the handler" "1 threw a" $
      pending $ \waits record ->
        (throwIO (Fault "x") `catch` \(Fault _) -> waits >> record "1") >> record "2"
  , Fixed "is raised where the handler blocks" "1 threw a" $
      pending (\waits record -> throwIO (Fault "x") `catch` \(Fault _) -> waits >> record "1" >> hang >> record "2")
  , Fixed "is not raised where the handler throws" "1 threw b" $
      pending $ \waits record ->
        throwIO (Fault "x") `catch` \(Fault _) -> waits >> record "1" >> throwIO (Cancel "b") >> pure ()
  , Fixed "is raised after the handler for the handler's own exception" "1 2 threw a" $
      pending $ \waits record ->
        (throwIO (Fault "x") `catch` \(Fault _) -> waits >> record "1" >> throwIO (Fault "y") >> pure ())
          `catch` \(Fault _) -> record "2"
  , Fixed "is raised after try has returned" "threw a" $
      pending (\waits _ -> (try (mask_ (waits >> throwIO (Fault "x"))) :: IO (Either Fault ())))
  , Fixed "interrupts a cleanup that blocks" "threw b" $ do
      t <- thread "target" (hang `finally` hang :: IO ())
      a <- throwsTo t "a"
      b <- throwsTo t "b"
      endOf t <* endOf a <* endOf b
  , Fixed "does not interrupt a cleanup that need not block" "1 2 threw a" $ do
      gate <- newGate
      logged <- newLog
      t <-
        thread
          "target"
          (hang `finally` (note logged "1" >> uninterruptibleMask_ (pass gate) >> note logged "2") :: IO ())
      a <- throwsTo t "a"
      b <- throwsTo t "b"
      open gate
      end <- endOf t
      mapM_ endOf [a, b]
      (\recorded -> unwords (recorded ++ [end])) <$> notes logged
  ]

senders :: [Fixed]
senders =
  [ Fixed "that is interrupted while it blocks has thrown nothing" "threw b done" $ withdrawn id
  , Fixed "that is interrupted while it blocks, masked, has thrown nothing" "threw b done" $ withdrawn mask_
  , Fixed "that is masked uninterruptibly stays blocked" "threw b threw a" $ withdrawn uninterruptibleMask_
  , Fixed "that was interrupted may throw another exception" "() threw c" $ do
      gate <- newGate
      t <- thread "target" (uninterruptibleMask_ (pass gate) >> pure (Plain "done"))
      w <- thread "thrower" (send t "a" `catch` \(Cancel _) -> send t "c")
      b <- throwsTo w "b"
      untilBlocked w
      open gate
      end <- endOf t
      end' <- endOf w
      _ <- endOf b
      pure (unwords [end', end])
  , Fixed "continues when the target ends" "done ()" $ do
      gate <- newGate
      t <- thread "target" (uninterruptibleMask_ (pass gate >> throwIO (Cancel "done")) :: IO ())
      w <- throwsTo t "a"
      open gate
      _ <- endOf t
      (\end -> unwords ["done", end]) <$> endOf w
  , Fixed "continues when the target has received the exception, and does not wait for its cleanup" "() threw a" $ do
      gate <- newGate
      t <- thread "target" (hang `finally` pass gate :: IO ())
      w <- throwsTo t "a"
      end <- endOf w
      open gate
      end' <- endOf t
      pure (unwords [end, end'])
  , Fixed "can be interrupted by its target" "threw b done" $ do
      gate <- newGate
      sender <- newTVarIO Nothing
      -- (Uninterruptible, since on two capabilities it may have to wait for the sender.)
      t <- thread "target" $ uninterruptibleMask_ $ do
        pass gate
        Just w <- atomically (readTVar sender)
        interrupt w (Cancel "b")
        pure (Plain "done")
      w <- throwsTo t "a"
      atomically (writeTVar sender (Just (memberId w)))
      open gate
      end <- endOf w
      end' <- endOf t
      pure (unwords [end, end'])
  , Fixed "may throw an exception of a synchronous type" "threw Fault \"x\"" $ do
      gate <- newGate
      t <- thread "target" (uninterruptibleMask_ (pass gate))
      w <- thread "thrower" (interrupt (memberId t) (Fault "x"))
      open gate
      endOf t <* endOf w
  ]
 where
  send t = interrupt (memberId t) . Cancel
  withdrawn masking = do
    gate <- newGate
    t <- thread "target" (uninterruptibleMask_ (pass gate) >> pure (Plain "done"))
    w <- thread "thrower" (masking (send t "a"))
    b <- throwsTo w "b"
    open gate
    end <- endOf t
    end' <- endOf w
    _ <- endOf b
    pure (unwords [end', end])

itself :: [Fixed]
itself =
  [ Fixed "is raised at once" "1 threw a" $ alone (\record -> record "1" >> self "a" >> record "2")
  , Fixed "is raised at once in a mask" "1 2 ()" $
      alone (\record -> mask_ ((record "1" >> self "a") `catch` \(Cancel _) -> record "2"))
  , Fixed "is raised at once in an uninterruptible mask" "1 2 ()" $
      alone (\record -> uninterruptibleMask_ ((record "1" >> self "a") `catch` \(Cancel _) -> record "2"))
  , Fixed "is raised at once in a handler" "1 threw a" $
      alone (\record -> throwIO (Fault "x") `catch` \(Fault _) -> record "1" >> self "a" >> record "2")
  , Fixed "is raised before what is pending" "b 1 threw a" $
      pending (\waits record -> mask_ (waits >> (self "b" `catch` recording record) >> record "1"))
  ]
 where
  self name = myThreadId >>= \me -> interrupt me (Cancel name)
  alone act = do
    logged <- newLog
    t <- thread "target" (act (note logged))
    end <- endOf t
    (\recorded -> unwords (recorded ++ [end])) <$> notes logged

operators :: [Fixed]
operators =
  [ Fixed "like ? does not run the second behaviour when the first was interrupted at its unmask" "threw a" $
      pending (\waits record -> (waits >> failWith "no") ? record "1")
  , Fixed "like ? does not run the second behaviour when the first failed in a mask" "threw a" $
      pending (\waits record -> mask_ (waits >> failWith "no") ? record "1")
  , Fixed "that has requested the stop of its branch stops it at the branch's unmask" "stopped" $ stopRequested pure
  , Fixed "that has requested the stop of its branch stops it before a checkpoint" "stopped" $
      stopRequested (<$ checkpoint)
  , Fixed "that has requested the stop of its branch stops it at restore" "stopped" $
      stopRequested (\a -> a <$ mask (\restore -> restore checkpoint))
  , Fixed "like parallel stops the loser at its unmask" "()" $ do
      first <- newGate
      gate <- newGate
      logged <- newLog
      inside <- newGate
      t <- thread "operator" (parallel (pass first) (masked inside gate >> note logged "goes on"))
      pass inside
      open first
      untilQuiet t
      open gate
      end <- endOf t
      (\recorded -> unwords (recorded ++ [end])) <$> notes logged
  , Fixed "that waits for a loser is cancelled when the loser has ended" "threw a" $ do
      first <- newGate
      gate <- newGate
      inside <- newGate
      t <- thread "operator" (firstOf [Plain "1" <$ pass first, Plain "2" <$ masked inside gate])
      pass inside
      open first
      untilQuiet t
      a <- throwsTo t "a"
      open gate
      endOf t <* endOf a
  , Fixed "runs its branches unmasked" "Unmasked Unmasked ()" $ do
      logged <- newLog
      let record = getMaskingState >>= note logged . show
      t <- thread "operator" (uninterruptibleMask_ (both record record))
      end <- endOf t
      (\recorded -> unwords (recorded ++ [end])) <$> notes logged
  ]
 where
  -- The condition becomes false while the branch is masked uninterruptibly.
  stopRequested :: (Plain -> Behavior Plain) -> IO String
  stopRequested further = do
    holds <- newTVarIO True
    gate <- newGate
    inside <- newGate
    t <-
      thread "operator" $
        Signal.whileHolding (watching (readTVar holds)) (masked inside gate >> further (Plain "done"))
          ? pure (Plain "stopped")
    pass inside
    atomically (writeTVar holds False)
    untilQuiet t
    open gate
    endOf t

  -- Masked uninterruptibly from the opening of the first gate to that of the second.
  masked inside gate = uninterruptibleMask_ (open inside >> pass gate)

-- | Shown without quotation marks.
newtype Plain = Plain String

instance Show Plain where
  show (Plain text) = text
