{-# OPTIONS_HADDOCK not-home #-}

-- |
-- A connection that nothing on the way can read or change (TLS, by OpenSSL).
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Tls
  ( withTls
  ) where

import Control.Exception (catch, throwIO, toException)
import Control.Monad (void)
import qualified Data.ByteString as Strict
import qualified Data.ByteString.Lazy as Lazy
import Network.Socket (Socket)
import OpenSSL (withOpenSSL)
import qualified OpenSSL.Session as Tls

import Behavior (tryAny)

-- | Encrypts the connection to the host, and runs the action with what receives from it and sends to it, if the host
-- has proved its name: by a certificate in the file, or by one that the system trusts.
withTls ::
  Maybe FilePath
  -> String
  -> (IO Strict.ByteString -> (Maybe Lazy.ByteString -> IO ()) -> IO a)
  -> Socket
  -> IO a
withTls trusted host use socket = withOpenSSL $ do
  context <- checking trusted
  connection <- Tls.connection context socket
  Tls.setTlsextHostName connection host
  Tls.enableHostnameValidation connection host
  Tls.connect connection `catch` refused connection
  use (Tls.read connection 32768) (maybe (goodbye connection) (Tls.lazyWrite connection))
 where
  -- (OpenSSL's own text can be that of another connection.)
  refused connection e = do
    isProved <- Tls.getVerifyResult connection
    throwIO (if isProved then toException (e :: Tls.SomeSSLException) else toException notProved)
  notProved = userError ("no certificate that is trusted proves that it is " ++ host)
  goodbye connection = void (tryAny (Tls.shutdown connection Tls.Unidirectional))

-- | What checks certificates.
checking :: Maybe FilePath -> IO Tls.SSLContext
checking trusted = do
  context <- Tls.context
  Tls.contextSetDefaultCiphers context
  maybe (Tls.contextSetDefaultVerifyPaths context) (Tls.contextSetCAFile context) trusted
  Tls.contextSetVerificationMode context (Tls.VerifyPeer True False Nothing)
  pure context
