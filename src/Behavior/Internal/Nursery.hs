{-# LANGUAGE LambdaCase #-}

-- |
-- Behaviours that run beside a scoped one.
module Behavior.Internal.Nursery
  ( Nursery
  , scoped
  , fork
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (ErrorCall (..), finally, throwIO)
import Control.Monad (filterM)
import Data.Foldable (asum)
import Data.Maybe (isJust)
import Data.Traversable (for)

import Behavior.Internal.Failure (Behavior)
import Behavior.Internal.Parallel (tellTrouble, told)
import Behavior.Internal.Runtime (Label (..), atomically)
import Behavior.Internal.Scope

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Time (atomically)

-- | A place where behaviours run beside a 'scoped' one.
--
-- @since 0.1.0.0
newtype Nursery = Nursery (TVar Stage)

-- | How far a nursery has come.
data Stage
  = -- | What is to be forked next, the newest first.
    Open [Request]
  | -- | All is being stopped. Some may just be forking, in a cleanup even: what they
    -- fork is taken for stopped before it began.
    Ending
  | -- | All has ended.
    Closed

-- | A behaviour to fork, and where to say that it was started.
data Request = Request (Behavior ()) (TMVar ())

-- | Runs a behaviour that may 'fork' others, which are stopped when it ends.
--
-- [Result] That of the behaviour. What was forked is then asked to stop, all at
--   once, and has ended when 'scoped' returns.
-- [Failure] If a forked behaviour fails, the scoped one and all the others are
--   stopped, and that failure is thrown.
-- [Fault] The leftmost fault (the scoped behaviour's before those of the forked,
--   in the order in which they were forked), in a cleanup too, is always thrown.
-- [Cancellation] All are asked to stop at once; it returns after all have ended.
--
-- >>> :{
-- scoped $ \nursery -> do
--   picture <- fork nursery (pure "a picture of the room")
--   putStrLn "driving on meanwhile"
--   atomically picture
-- :}
-- driving on meanwhile
-- "a picture of the room"
--
-- @since 0.1.0.0
scoped :: (Nursery -> Behavior a) -> Behavior a
scoped body = do
  requests <- newTVarIO (Open [])
  structured (\scope -> serving requests scope `finally` atomically (writeTVar requests Ending))
    `finally` atomically (writeTVar requests Closed)
 where
  serving requests scope = do
    trouble <- newTVarIO Nothing
    main <- branch scope (Label "scoped" "body") (body (Nursery requests))
    let -- How many were forked; those of them that live, or died of something, the newest
        -- first; and at how many to look next for those that are no more.
        serve count children limit = do
          next <- atomically (asum [Left . settle <$> outcome main, Left . throwIO <$> told trouble, Right <$> arrived])
          case next of
            Left verdict -> pure verdict
            Right new -> do
              forked <- for (zip [count + 1 ..] new) $ \(n, Request act accepted) ->
                branchThen (tellTrouble trouble n) scope (Label "scoped" "fork") act
                  <* atomically (putTMVar accepted ())
              let family = reverse forked ++ children
                  more = serve (count + length new)
              if length family < limit
                then more family limit
                else filterM alive family >>= \living -> more living (max 16 (2 * length living))
        arrived =
          readTVar requests >>= \case
            Open new@(_ : _) -> reverse new <$ writeTVar requests (Open [])
            _ -> retry
        alive child = do
          over <- isJust <$> completedNow child
          if over then False <$ forget scope child else pure True
    serve 0 [] 16

-- | Starts a behaviour that runs until it ends by itself, or 'scoped' ends. The
-- transaction that it returns waits for the result.
--
-- While all is being stopped (in a cleanup, say) nothing is started any more, and the
-- result never comes. Outside its 'scoped' the nursery is closed: an 'ErrorCall' (a
-- fault) says so.
--
-- @since 0.1.0.0
fork :: Nursery -> Behavior a -> Behavior (STM a)
fork (Nursery requests) act = do
  answer <- newEmptyTMVarIO
  accepted <- newEmptyTMVarIO
  let request = Request (act >>= atomically . putTMVar answer) accepted
  atomically $ ifOpen (writeTVar requests . Open . (request :))
  atomically $ takeTMVar accepted `orElse` ifOpen (const retry)
  pure (readTMVar answer)
 where
  ifOpen further =
    readTVar requests >>= \case
      Open waiting -> further waiting
      Ending -> pure ()
      Closed -> throwSTM (ErrorCall "fork: the nursery's scoped behaviour has ended")
