{-# OPTIONS_HADDOCK not-home #-}

-- |
-- A connection to a host.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Socket
  ( withSocket
  ) where

import Control.Exception (bracket, bracketOnError, throwIO, try)
import Network.Socket hiding (socket)

import Behavior.Time (abandoning)

-- | Connects to the host and port: to the first of its addresses that can be reached.
withSocket :: String -> Int -> (Socket -> IO a) -> IO a
withSocket host port = bracket (addresses >>= firstThatConnects) close
 where
  -- (Nothing interrupts the system while it asks a name server that does not answer: some ten seconds.)
  addresses = abandoning 0.1 (getAddrInfo (Just defaultHints {addrSocketType = Stream}) (Just host) (Just (show port)))

firstThatConnects :: [AddrInfo] -> IO Socket
firstThatConnects = go (ioError (userError "the host has no address"))
 where
  go failed [] = failed
  go _ (address : others) = try (connected address) >>= either (\e -> go (throwIO (e :: IOError)) others) pure
  connected address = bracketOnError (openSocket address) close $ \socket -> do
    setSocketOption socket NoDelay 1
    socket <$ connect socket (addrAddress address)
