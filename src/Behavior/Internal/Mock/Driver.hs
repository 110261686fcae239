{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Scripted drivers, which deliver messages by calling back.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.Driver (driver) where

import Control.Exception
  ( Exception (..)
  , asyncExceptionFromException
  , asyncExceptionToException
  , mask_
  , throwIO
  , uninterruptibleMask_
  )
import Data.Foldable (for_)

import Behavior.Internal.Mock.Subject (SubjectKind (ADriver))
import Behavior.Internal.Mock.World
import Behavior.Internal.Seam.Runtime

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Message
-- >>> import Behavior.STM
-- >>> import Behavior.Sim.Mock
-- >>> import Behavior.Time
-- >>> mock <- newMock

-- | Makes a driver with the given name, which delivers messages at the given times: in seconds since
-- the clock of the world was started (see 'begin'). It is a function for
-- 'Behavior.Message.withInbox': it takes the callback, and returns the action that ends the
-- subscription.
--
-- The times are zero or more, and do not decrease. A subscription delivers, from a thread of its own, the
-- messages that are due from its beginning on. (So on real threads it does not deliver a message for time 0, if
-- the clock was started before.) The record has a note for each message and for the subscription's
-- beginning and end: @orders: \"tea\"@, @orders: subscribed@, @orders: unsubscribed@.
--
-- Times that decrease, or a name that is already used in this world, are rejected with an
-- 'Control.Exception.ErrorCall'. If the callback throws, the action that ends the subscription throws the same.
--
-- >>> orders <- driver mock "orders" [(0.001, "tea"), (0.002, "milk")]
-- >>> withInbox 10 orders $ \inbox -> (,) <$> atomically (receive inbox) <*> atomically (receive inbox)
-- ("tea","milk")
-- >>> mock `shouldRecord` comesBefore (noted "orders: \"milk\"") (noted "orders: unsubscribed")
--
-- @since 0.1.0.0
driver :: Show e => Mock -> String -> [(Seconds, e)] -> IO ((e -> IO ()) -> IO (IO ()))
driver mock name messages = do
  checkTimes
    (<=)
    ("driver " ++ show name ++ ": the times of the messages start from zero and do not decrease")
    (map fst messages)
  register mock ADriver name
  pure $ \deliver -> do
    (zero, t) <- clock mock
    let due = dropWhile ((< t - zero) . fst) messages
    saying "subscribed"
    thread <- mask_ . start (Label "driver" name) . for_ due $ \(at, e) ->
      sleepUntil (zero + at) >> saying (show e) >> deliver e
    pure . uninterruptibleMask_ $ do
      interrupt (threadId thread) Unsubscribed
      end <- atomically (threadEnd thread)
      saying "unsubscribed"
      either (\e -> maybe (throwIO e) (\Unsubscribed -> pure ()) (fromException e)) pure end
 where
  saying what = note mock (name ++ ": " ++ what)

-- | Ends the thread of a subscription.
data Unsubscribed = Unsubscribed
  deriving (Show)

-- (Asynchronous, so that a callback's handler for other exceptions does not catch it.)
instance Exception Unsubscribed where
  toException = asyncExceptionToException
  fromException = asyncExceptionFromException
