{-# LANGUAGE OverloadedStrings #-}

-- |
-- A link that is encrypted (wss).
module Ros.TlsSpec (spec) where

import Control.Concurrent (rtsSupportsBoundThreads)
import Control.Exception (try)
import qualified Data.ByteString as Strict
import Data.Foldable (traverse_)
import Data.Time (addUTCTime, getCurrentTime)
import qualified Network.WebSockets as Websockets
import Network.WebSockets.Stream (makeStream)
import OpenSSL (withOpenSSL)
import OpenSSL.PEM (writeX509)
import OpenSSL.RSA (RSAKeyPair, generateRSAKey')
import qualified OpenSSL.Session as Tls
import OpenSSL.X509
import Test.Hspec hiding (context)

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Fake
import Behavior.STM
import qualified Behavior.Signal as Signal
import Ros.Bridge
import Ros.Stage
import Support (guarded)
import Temporary (withPath)

spec :: Spec
spec =
  guarded $
    if rtsSupportsBoundThreads
      then encrypted
      else it "needs -threaded" $
        withRos (rosbridge "wss://localhost:9090") (\_ -> pure ())
          `shouldThrow` errorCall "rosbridge: wss needs a program that is linked with -threaded"

encrypted :: Spec
encrypted = beforeAll (withOpenSSL (generateRSAKey' 2048 65537)) $ do
  it "gives the result of a goal, if the bridge's certificate is trusted and names its host" $ \key ->
    withCertificate key "127.0.0.1" $ \file ->
      over (tlsServer key file) (trusting file) patient $ \_ ros -> carrying ros "cup" >>= (`shouldBe` "a cup")
  it "does not come up with a certificate that the system does not trust" $ \key ->
    withCertificate key "127.0.0.1" $ \file ->
      refusedBy (tlsServer key file) (\port -> rosbridge ("wss://127.0.0.1:" ++ port)) unproved
  it "does not come up with a certificate that names another host" $ \key ->
    withCertificate key "elsewhere" $ \file ->
      refusedBy (tlsServer key file) (trusting file) unproved
  it "does not come up with a bridge that does not encrypt" $ \_ ->
    refusedBy plainly (\port -> rosbridge ("wss://127.0.0.1:" ++ port)) ""
  it "is required where there are certificates" $ \_ ->
    withRos (rosbridgeTrusting "robot.pem" "ws://localhost:9090") (\_ -> pure ())
      `shouldThrow` errorCall "rosbridge: certificates are for wss://HOST:PORT or wss://HOST:PORT/PATH"
 where
  unproved = "no certificate that is trusted proves that it is 127.0.0.1"
  trusting file port = rosbridgeTrusting file ("wss://127.0.0.1:" ++ port)
  refusedBy server way why =
    over server way patient {noServerAfter = 0.1} $ \robot ros -> do
      let attempts = length <$> seen robot
      -- (When the second attempt has begun, the first has failed.)
      firstOf [atomically (attempts >>= check . (>= 2)), Signal.waitUntil (linkUp ros)]
      end <- try (carrying ros "cup")
      case end of
        Left (NoServer _ said) -> said `shouldContain` why
        other -> expectationFailure (show other)
      -- (The bridge was reached, and has received nothing of the mission.)
      came <- map snd <$> atomically (seen robot)
      filter (/= Connected) came `shouldBe` []

-- | A mission with that server, and that way to its port.
over :: Server -> (String -> Transport) -> RosOptions -> (FakeRobot -> Ros -> Behavior a) -> Behavior a
over server way options act =
  withFakeRobot [("/carry", const succeeding {endsWith = Succeeds "a cup"})] $ \robot ->
    withBridgeOver server robot (\port -> withRosOptions options (way port) (act robot))

-- | With that key, and the certificate in that file.
tlsServer :: RSAKeyPair -> FilePath -> Server
tlsServer key file socket = withOpenSSL $ do
  context <- Tls.context
  Tls.contextSetPrivateKey context key
  Tls.contextSetCertificateFile context file
  connection <- Tls.connection context socket
  Tls.accept connection
  let receive = (\bytes -> if Strict.null bytes then Nothing else Just bytes) <$> Tls.read connection 32768
  stream <- makeStream receive (traverse_ (Tls.lazyWrite connection))
  Websockets.makePendingConnectionFromStream stream Websockets.defaultConnectionOptions

-- | With the file of a certificate for that host, which is signed by its own key.
withCertificate :: RSAKeyPair -> String -> (FilePath -> IO a) -> IO a
withCertificate key host use = withPath $ \file -> do
  withOpenSSL $ do
    certificate <- newX509
    setVersion certificate 2
    setSerialNumber certificate 1
    setIssuerName certificate [("CN", host)]
    setSubjectName certificate [("CN", host)]
    time <- getCurrentTime
    setNotBefore certificate (addUTCTime (-3600) time)
    setNotAfter certificate (addUTCTime 3600 time)
    setPublicKey certificate key
    signX509 certificate key Nothing
    writeX509 certificate >>= writeFile file
  use file
