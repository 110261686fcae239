{-# OPTIONS_HADDOCK not-home #-}

-- |
-- A stream to a bridge that nothing on the way can read or change (TLS, by OpenSSL).
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Tls
  ( withTls
  ) where

import Control.Exception (SomeException, bracket, bracketOnError, throwIO, try)
import Control.Monad (void)
import qualified Data.ByteString as Strict
import Network.Socket hiding (socket)
import Network.WebSockets.Stream (Stream, makeStream)
import OpenSSL (withOpenSSL)
import qualified OpenSSL.Session as Tls

-- | Connects to the host and port, and runs the action with the stream if the host has proved its name: by a
-- certificate in the file, or by one that the system trusts.
withTls :: Maybe FilePath -> String -> Int -> (Stream -> IO a) -> IO a
withTls trusted host port use = withOpenSSL $ do
  context <- checking trusted
  addresses <- getAddrInfo (Just defaultHints {addrSocketType = Stream}) (Just host) (Just (show port))
  bracket (firstThatConnects addresses) close $ \socket -> do
    connection <- Tls.connection context socket
    Tls.setTlsextHostName connection host
    Tls.enableHostnameValidation connection host
    Tls.connect connection
    makeStream (receive connection) (maybe (goodbye connection) (Tls.lazyWrite connection)) >>= use
 where
  receive connection = (\bytes -> bytes <$ guardEnd bytes) <$> Tls.read connection 32768
  guardEnd bytes = if Strict.null bytes then Nothing else Just ()
  goodbye connection = void (try (Tls.shutdown connection Tls.Unidirectional) :: IO (Either SomeException ()))

-- | What checks certificates.
checking :: Maybe FilePath -> IO Tls.SSLContext
checking trusted = do
  context <- Tls.context
  Tls.contextSetDefaultCiphers context
  maybe (Tls.contextSetDefaultVerifyPaths context) (Tls.contextSetCAFile context) trusted
  Tls.contextSetVerificationMode context (Tls.VerifyPeer True False Nothing)
  pure context

-- | A socket that is connected to one of the addresses, tried in their order.
firstThatConnects :: [AddrInfo] -> IO Socket
firstThatConnects = go (ioError (userError "the host has no address"))
 where
  go failed [] = failed
  go _ (address : others) = try (connected address) >>= either (\e -> go (throwIO (e :: IOError)) others) pure
  connected address = bracketOnError (openSocket address) close $ \socket -> do
    setSocketOption socket NoDelay 1
    socket <$ connect socket (addrAddress address)
