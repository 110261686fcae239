-- |
-- Messages: data that a driver delivers by calling back, each of which is to be handled. (A value of
-- which only the latest matters is better kept in a variable, and watched: "Behavior.Signal".)
--
-- > import Behavior
-- > import Behavior.Message
-- >
-- > serving :: Inbox Order -> Behavior a -> Behavior a
-- > serving orders = onMessage orders (\order -> deliver order >> pure (markDelivered order))
--
-- "Behavior.Sim.Mock" has a driver for tests: 'Behavior.Sim.Mock.driver'.
module Behavior.Message
  ( -- * Receiving
    Inbox
  , withInbox
  , namedInbox
  , namedInboxWith

    -- * Handling each message
  , onMessage
  , messageRule
  , handleNext

    -- * In transactions
  , receive
  , unhandled
  , dropped
  ) where

import Behavior.Internal.Reactive.Inbox
