{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What can be set for a fleet.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Options
  ( FleetOptions (..)
  , defaultFleetOptions
  , notAllowed
  ) where

import Control.Applicative ((<|>))
import Data.Maybe (listToMaybe)

import Behavior (Behavior, Seconds)

-- | What can be set.
--
-- @since 0.1.0.0
data FleetOptions = FleetOptions
  { taskTerm :: Seconds
  -- ^ How long the lease of a task is valid, from 0.1 s to a day; 10 s by default. It is renewed at each third of that.
  -- When a robot's process is killed, its task is started again after this time.
  , answerWithin :: Seconds
  -- ^ How long a statement may take, or its connection is given up; 2 s by default. (Also what a task writes.)
  , noDatabaseAfter :: Seconds
  -- ^ How long what is asked of the database waits for it, over all attempts, before it fails with 'NoDatabase'; 60 s
  -- by default. An infinite time is no limit. (Serving a queue waits for as long as it takes.)
  , pollEvery :: Seconds
  -- ^ How often the process asks for what it may have missed, and says that it is there; 5 s by default.
  , connectAgainAfter :: Seconds
  -- ^ The pause before it connects again, which grows to twice as much each time; 0.1 s by default.
  , connectAgainWithin :: Seconds
  -- ^ The longest such pause; 2 s by default.
  , pageAddress :: Maybe String
  -- ^ The address of this process's live page, for those who look at the fleet, and for @behavior-fleet hub@; none by
  -- default.
  , onFleetReport :: String -> Behavior ()
  -- ^ What is done with a line about the connection, or about a start of a task that has failed; nothing by default.
  }

-- | The defaults that are documented for each field of 'FleetOptions'.
--
-- @since 0.1.0.0
defaultFleetOptions :: FleetOptions
defaultFleetOptions =
  FleetOptions
    { taskTerm = 10
    , answerWithin = 2
    , noDatabaseAfter = 60
    , pollEvery = 5
    , connectAgainAfter = 0.1
    , connectAgainWithin = 2
    , pageAddress = Nothing
    , onFleetReport = \_ -> pure ()
    }

-- | What is wrong with the first of these that is not allowed.
notAllowed :: FleetOptions -> Maybe String
notAllowed chosen =
  listToMaybe
    [ name ++ " is " ++ show seconds ++ " s; allowed: " ++ show least ++ " to " ++ show most ++ " s"
    | (name, seconds, least, most) <-
        [ ("taskTerm", taskTerm chosen, 0.1, 86400)
        , ("answerWithin", answerWithin chosen, 0.01, 3600)
        , ("noDatabaseAfter", noDatabaseAfter chosen, 0.01, 1 / 0)
        , ("pollEvery", pollEvery chosen, 0.1, 3600)
        , ("connectAgainAfter", connectAgainAfter chosen, 0.001, 3600)
        , ("connectAgainWithin", connectAgainWithin chosen, connectAgainAfter chosen, 3600)
        ]
    , not (seconds >= least && seconds <= most)
    ]
    <|> listToMaybe
      ["pageAddress has the character U+0000; allowed: text without it" | any (elem '\0') (pageAddress chosen)]
