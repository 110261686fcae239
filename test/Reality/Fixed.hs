-- |
-- Programs whose outcome GHC fixes, although several threads take part: one and the same in
-- every real run, so in every simulated one.
--
-- Each starts a target, and threads that throw to it; gates decide what is first.
module Reality.Fixed
  ( Fixed (..)
  , table
  ) where

import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
import Control.Exception
import Control.Monad (void)

import Behavior (Behavior, failWith, (?))
import Behavior.Internal.Runtime (atomically, checkpoint, interrupt, now)
import Behavior.Parallel (both, firstOf, parallel)
import Behavior.Signal (watching)
import qualified Behavior.Signal as Signal
import Control.Concurrent (myThreadId)
import Reality.Stage
import Support

-- | A program, and what it always says.
data Fixed = Fixed
  { called :: String
  , says :: String
  , program :: IO String
  }

table :: [(String, [Fixed])]
table =
  [ ("The target", targets)
  , ("At the unmask", unmasking)
  , ("Several that are pending", several)
  , ("In a handler", handlers)
  , ("The sender", senders)
  , ("What a thread throws to itself", itself)
  , ("An operator", operators)
  ]

-- | The target cannot be interrupted until a gate opens; meanwhile this is thrown to it. What it
-- says is what it recorded, and how it ended.
pending :: Show a => (IO () -> (String -> IO ()) -> IO a) -> IO String
pending = pendingAll ["a"]

-- | The same with several, one after the other.
pendingAll :: Show a => [String] -> (IO () -> (String -> IO ()) -> IO a) -> IO String
pendingAll names target = do
  gate <- newGate
  book <- newLog
  t <- thread "target" (framed (target (uninterruptibleMask_ (pass gate)) (note book)))
  throwers <- traverse (throwsTo t) names
  open gate
  end <- endOf t
  mapM_ endOf throwers
  recorded <- notes book
  pure (unwords (recorded ++ [end]))

-- | The action, above a frame of its own on the stack. (Where a mask is the last thing that is
-- done unmasked, and what called it is masked, GHC leaves the unmask out.)
framed :: IO a -> IO a
framed act = act `catch` \e -> throwIO (e :: SomeException)

-- | This is thrown to the target once it is blocked.
thrownTo :: Show a => ((String -> IO ()) -> IO a) -> IO String
thrownTo target = do
  book <- newLog
  t <- thread "target" (target (note book))
  w <- throwsTo t "a"
  end <- endOf t
  _ <- endOf w
  recorded <- notes book
  pure (unwords (recorded ++ [end]))

targets :: [Fixed]
targets =
  [ Fixed "is interrupted where it is blocked" "threw a" $ thrownTo (const nothing)
  , Fixed "is interrupted where it is blocked, masked" "threw a" $ thrownTo (\_ -> mask_ nothing)
  , Fixed "is interrupted where it waits to acquire, and releases nothing" "threw a" $
      thrownTo (\say -> bracket nothing (\_ -> say "release") (\_ -> say "use"))
  , Fixed "that has ended receives nothing" "ended () ()" $ do
      t <- thread "target" (pure ())
      w <- throwsTo t "a"
      endOf t >>= \end -> endOf w >>= \end' -> pure (unwords ["ended", end, end'])
  , Fixed "that has not begun receives it before it waits" "threw a ()" $ do
      t <- member "target" nothing
      w <- member "thrower" (interrupt (memberId t) (Cancel "a"))
      endOf t >>= \end -> endOf w >>= \end' -> pure (unwords [end, end'])
  , Fixed "that has not begun is asked by its parent" "threw a" $ do
      t <- member "target" (mask_ nothing)
      interrupt (memberId t) (Cancel "a")
      endOf t
  , Fixed "that is masked goes on where it need not wait" "1 2 threw a" $
      pending (\waits say -> mask_ (waits >> say "1" >> checkpoint >> say "2"))
  , Fixed "that is masked goes on through a gate that is open" "1 threw a" $
      pending (\waits say -> newGate >>= \gate -> open gate >> mask_ (waits >> pass gate >> say "1"))
  , Fixed "that is masked receives it at the next wait" "1 threw a" $
      pending (\waits say -> mask_ (waits >> say "1" >> nothing >> say "2"))
  , Fixed "that is uninterruptible waits on" "1 2 threw a" $ do
      gate <- newGate
      pending $ \waits say -> do
        uninterruptibleMask_ $ do
          waits
          say "1"
          opener <- member "opener" (open gate)
          pass gate
          say "2"
          void (endOf opener)
  , Fixed "that ends masked by an exception of its own never receives it" "1 threw b" $
      pending (\waits say -> uninterruptibleMask_ (waits >> say "1" >> throwIO (Cancel "b") :: IO ()))
  , Fixed "has these masking states" states $ mask_ $ do
      book <- newLog
      let say = getMaskingState >>= note book . take 9 . show
      t <- thread "target" $ do
        say
        mask_ (say >> interruptible say >> uninterruptibleMask_ (say >> interruptible say) >> say)
        mask (\restore -> restore say >> mask (\restore' -> restore' say))
        uninterruptibleMask (\restore -> mask_ say >> restore say)
        throwIO (Fault "x") `catch` \(Fault _) -> say
        uninterruptibleMask_ (throwIO (Fault "x") `catch` \(Fault _) -> say)
        (throwIO (Fault "x") `onException` say) `catch` \(Fault _) -> interruptible say
        bracket_ say say say
        say
      _ <- endOf t
      unwords <$> notes book
  ]
 where
  nothing = hang :: IO ()
  states =
    "Unmasked MaskedInt Unmasked MaskedUni MaskedUni MaskedInt Unmasked MaskedInt MaskedUni Unmasked"
      ++ " MaskedInt MaskedUni MaskedInt Unmasked MaskedInt Unmasked MaskedInt Unmasked"

unmasking :: [Fixed]
unmasking =
  [ Fixed "it is raised, though nothing follows" "threw a" $ pending const
  , Fixed "it is raised, and no result is returned" "threw a" $ pending (\waits _ -> "done" <$ waits)
  , Fixed "it is raised before a checkpoint" "threw a" $ pending (\waits _ -> waits >> checkpoint >> pure "done")
  , Fixed "it is raised before the clock is read" "threw a" $ pending (\waits _ -> waits >> now)
  , Fixed "it is raised before a transaction" "threw a" $ pending (\waits say -> waits >> say "1")
  , Fixed "it is raised at the end of the outermost mask" "1 threw a" $
      pending (\waits say -> mask_ (mask_ (mask_ waits) >> say "1") >> say "2")
  , Fixed "it is raised inside of a handler that was there" "1 ()" $
      pending (\waits say -> waits `catch` \(Cancel _) -> say "1")
  , Fixed "it is not raised inside of a handler that was in the mask" "threw a" $
      pending (\waits say -> mask_ (waits `catch` \(Cancel _) -> say "1"))
  , Fixed "a cleanup runs" "1 threw a" $ pending (\waits say -> waits `finally` say "1")
  , Fixed "a cleanup in the mask does not" "threw a" $
      pending (\waits say -> mask_ (waits `onException` say "1"))
  , Fixed "it is raised at restore" "1 threw a" $
      pending (\waits say -> mask (\restore -> waits >> say "1" >> restore (pure ()) >> say "2"))
  , Fixed "it is raised at restore, before what is restored" "threw a" $
      pending (\waits say -> mask (\restore -> waits >> restore (checkpoint >> say "1")))
  , Fixed "it is raised at restore of the outer mask" "1 threw a" $
      pending (\waits say -> mask (\restore -> mask_ (waits >> say "1" >> restore (pure ()) >> say "2")))
  , Fixed "it is not raised at restore of an inner mask" "1 2 threw a" $
      pending (\waits say -> mask_ (mask (\restore -> waits >> say "1" >> restore (pure ()) >> say "2")))
  , Fixed "it is raised at restore of an uninterruptible mask" "1 threw a" $
      pending (\waits say -> uninterruptibleMask (\restore -> waits >> say "1" >> restore (pure ()) >> say "2"))
  , Fixed "it is raised at restore of an uninterruptible mask in a mask only where that waits" "1 2 threw a" $
      pending $ \waits say ->
        mask_ $ uninterruptibleMask $ \restore -> waits >> restore (say "1") >> say "2" >> restore hang >> say "3"
  , Fixed "it is raised by allowInterrupt" "1 threw a" $
      pending (\waits say -> mask_ (waits >> say "1" >> allowInterrupt >> say "2"))
  , Fixed "it is not raised by allowInterrupt in an uninterruptible mask" "1 2 threw a" $
      pending (\waits say -> uninterruptibleMask_ (waits >> say "1" >> allowInterrupt >> say "2"))
  , Fixed "it is raised by interruptible, before what is interruptible" "1 threw a" $
      pending (\waits say -> mask_ (waits >> say "1" >> interruptible (say "2") >> say "3"))
  , Fixed "it is raised by interruptible while that waits" "threw a" $
      thrownTo (\say -> mask_ (interruptible hang >> say "1"))
  , Fixed "it is received once" "1 2 done" $
      pending $ \waits say ->
        mask_ ((waits >> allowInterrupt) `catch` (\(Cancel _) -> say "1") >> allowInterrupt >> say "2")
          >> checkpoint
          >> pure (Plain "done")
  ]

several :: [Fixed]
several =
  [ -- (GHC raises the last one first.)
    Fixed "the second is raised as the first is received" "b a ()" $
      pendingAll ["a", "b"] $ \waits say -> (waits `catch` recording say) `catch` recording say
  , Fixed "each restore raises one" "b 1 a 2 ()" $
      pendingAll ["a", "b"] $ \waits say -> mask $ \restore -> do
        waits
        restore (pure ()) `catch` recording say
        say "1"
        restore (pure ()) `catch` recording say
        say "2"
  , Fixed "the second is raised where the handler of the first waits" "b threw a" $
      pendingAll ["a", "b"] (\waits say -> waits `catch` \e -> recording say e >> hang)
  , Fixed "the second is raised as the handler of the first returns" "b 1 threw a" $
      pendingAll ["a", "b"] (\waits say -> waits `catch` \e -> recording say e >> say "1")
  , Fixed "the second is not raised where the first ends the thread" "1 threw b" $
      pendingAll ["a", "b"] (\waits say -> waits `onException` say "1")
  , Fixed "one that was withdrawn is not raised" "c a ()" $ do
      gate <- newGate
      book <- newLog
      t <- thread "target" $
        (uninterruptibleMask_ (pass gate) `catch` recording (note book)) `catch` recording (note book)
      a <- throwsTo t "a"
      b <- throwsTo t "b"
      c <- throwsTo t "c"
      interrupt (memberId b) (Cancel "stop")
      _ <- endOf b
      open gate
      end <- endOf t
      mapM_ endOf [a, c]
      (\recorded -> unwords (recorded ++ [end])) <$> notes book
  ]

recording :: (String -> IO ()) -> Cancel -> IO ()
recording say (Cancel name) = say name

handlers :: [Fixed]
handlers =
  [ Fixed "it is raised as the handler returns" "1 threw a" $
      pending (\waits say -> throwIO (Fault "x") `catch` \(Fault _) -> waits >> say "1")
  , Fixed "it is raised before what follows the handler" "1 threw a" $
      pending $ \waits say ->
        (throwIO (Fault "x") `catch` \(Fault _) -> waits >> say "1") >> say "2"
  , Fixed "it is raised where the handler waits" "1 threw a" $
      pending (\waits say -> throwIO (Fault "x") `catch` \(Fault _) -> waits >> say "1" >> hang >> say "2")
  , Fixed "it is not raised where the handler throws" "1 threw b" $
      pending $ \waits say ->
        throwIO (Fault "x") `catch` \(Fault _) -> waits >> say "1" >> throwIO (Cancel "b") >> pure ()
  , Fixed "it is not raised in what catches what the handler throws, but after that" "1 2 threw a" $
      pending $ \waits say ->
        (throwIO (Fault "x") `catch` \(Fault _) -> waits >> say "1" >> throwIO (Fault "y") >> pure ())
          `catch` \(Fault _) -> say "2"
  , Fixed "try has returned by then" "threw a" $
      pending (\waits _ -> (try (mask_ (waits >> throwIO (Fault "x"))) :: IO (Either Fault ())))
  , Fixed "a cleanup that waits is interrupted by the second" "threw b" $ do
      t <- thread "target" (hang `finally` hang :: IO ())
      a <- throwsTo t "a"
      b <- throwsTo t "b"
      endOf t <* endOf a <* endOf b
  , Fixed "a cleanup that need not wait is not" "1 2 threw a" $ do
      gate <- newGate
      book <- newLog
      t <- thread "target" (hang `finally` (note book "1" >> uninterruptibleMask_ (pass gate) >> note book "2") :: IO ())
      a <- throwsTo t "a"
      b <- throwsTo t "b"
      open gate
      end <- endOf t
      mapM_ endOf [a, b]
      (\recorded -> unwords (recorded ++ [end])) <$> notes book
  ]

senders :: [Fixed]
senders =
  [ Fixed "that is interrupted while it waits has thrown nothing" "threw b done" $ withdrawn id
  , Fixed "that is interrupted while it waits, masked, has thrown nothing" "threw b done" $ withdrawn mask_
  , Fixed "that cannot be interrupted waits on" "threw b threw a" $ withdrawn uninterruptibleMask_
  , Fixed "may throw another thing then" "() threw c" $ do
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
  , Fixed "goes on when the target ends" "done ()" $ do
      gate <- newGate
      t <- thread "target" (uninterruptibleMask_ (pass gate >> throwIO (Cancel "done")) :: IO ())
      w <- throwsTo t "a"
      open gate
      _ <- endOf t
      (\end -> unwords ["done", end]) <$> endOf w
  , Fixed "goes on when the target has received it, and does not wait for its cleanup" "() threw a" $ do
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
      -- (It must not be interruptible: on two capabilities it may have to wait for the sender.)
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
  , Fixed "of what is not an asynchronous exception is no other" "threw Fault \"x\"" $ do
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
  [ Fixed "is raised at once" "1 threw a" $ alone (\say -> say "1" >> self "a" >> say "2")
  , Fixed "is raised at once in a mask" "1 2 ()" $
      alone (\say -> mask_ ((say "1" >> self "a") `catch` \(Cancel _) -> say "2"))
  , Fixed "is raised at once in an uninterruptible mask" "1 2 ()" $
      alone (\say -> uninterruptibleMask_ ((say "1" >> self "a") `catch` \(Cancel _) -> say "2"))
  , Fixed "is raised at once in a handler" "1 threw a" $
      alone (\say -> throwIO (Fault "x") `catch` \(Fault _) -> say "1" >> self "a" >> say "2")
  , Fixed "is raised before what is pending" "b 1 threw a" $
      pending (\waits say -> mask_ (waits >> (self "b" `catch` recording say) >> say "1"))
  ]
 where
  self name = myThreadId >>= \me -> interrupt me (Cancel name)
  alone act = do
    book <- newLog
    t <- thread "target" (act (note book))
    end <- endOf t
    (\recorded -> unwords (recorded ++ [end])) <$> notes book

operators :: [Fixed]
operators =
  [ Fixed "? does not go on to the second when the first was interrupted at its unmask" "threw a" $
      pending (\waits say -> (waits >> failWith "no") ? say "1")
  , Fixed "? does not go on to the second when the first failed in a mask" "threw a" $
      pending (\waits say -> mask_ (waits >> failWith "no") ? say "1")
  , Fixed "whose branch was asked to stop stops it at its unmask" "stopped" $ asked pure
  , Fixed "whose branch was asked to stop stops it before a checkpoint" "stopped" $ asked (<$ checkpoint)
  , Fixed "whose branch was asked to stop stops it at restore" "stopped" $
      asked (\a -> a <$ mask (\restore -> restore checkpoint))
  , Fixed "parallel stops the loser at its unmask" "()" $ do
      first <- newGate
      gate <- newGate
      book <- newLog
      inside <- newGate
      t <- thread "operator" (parallel (pass first) (masked inside gate >> note book "goes on"))
      pass inside
      open first
      untilQuiet t
      open gate
      end <- endOf t
      (\recorded -> unwords (recorded ++ [end])) <$> notes book
  , Fixed "that waits for a loser is cancelled when that has ended" "threw a" $ do
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
      book <- newLog
      let say = getMaskingState >>= note book . show
      t <- thread "operator" (uninterruptibleMask_ (both say say))
      end <- endOf t
      (\recorded -> unwords (recorded ++ [end])) <$> notes book
  ]
 where
  -- The condition stops holding while the branch cannot be interrupted.
  asked :: (Plain -> Behavior Plain) -> IO String
  asked further = do
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

  -- Cannot be interrupted once the first gate is open.
  masked inside gate = uninterruptibleMask_ (open inside >> pass gate)

-- | Shown without quotation marks.
newtype Plain = Plain String

instance Show Plain where
  show (Plain text) = text
