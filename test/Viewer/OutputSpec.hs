-- |
-- What the program prints while the tree is shown, in a terminal: a pseudo terminal in place of the standard output and
-- the standard error of this process.
module Viewer.OutputSpec (spec) where

import Control.Concurrent (forkIO)
import Control.Concurrent.MVar
import Control.Concurrent.STM
import Control.Exception (ErrorCall (..), IOException, bracket, finally, throwIO, try)
import Control.Monad (forM_, void)
import qualified Data.ByteString as Bytes
import qualified Data.ByteString.Char8 as Char8
import Data.List (isPrefixOf)
import System.Environment (lookupEnv, setEnv, unsetEnv)
import System.Exit (ExitCode (..))
import System.IO
import System.Posix.IO
import System.Posix.Terminal (openPseudoTerminal, queryTerminal)
import System.Process (callCommand)
import System.Timeout (timeout)
import Test.Hspec

import Behavior.Trace
import Behavior.Trace.Terminal
import Viewer.Examples (mission)
import Viewer.Screen

spec :: Spec
spec = before_ pseudoTerminals $ do
  it "is above the tree, whole and in order, of both handles" $ do
    let printed = concat [["out " ++ show n, "err " ++ show n] | n <- [1 .. 50 :: Int]]
    (_, output) <- inTerminal $ \h _ -> withTerminal h $ \sink -> do
      sink (take 3 mission)
      forM_ [1 .. 50 :: Int] $ \n -> putStrLn ("out " ++ show n) >> hFlush stdout >> hPutStrLn stderr ("err " ++ show n)
      sink (drop 3 mission)
    screen output `shouldSatisfy` \shown ->
      take 100 shown == printed && "\9679 mission" `elem` map (take 9) (drop 100 shown) && length shown > 105

  it "is lost nowhere, if there is much of it" $ do
    (_, output) <- inTerminal $ \h _ -> withTerminal h $ \sink -> do
      sink (take 3 mission)
      forM_ [1 .. 100000 :: Int] $ \n -> putStrLn ("line " ++ show n)
    let known = [l | l <- screen output, "line " `isPrefixOf` l]
    -- (A difference is reported briefly.)
    take 1 [(is, expected) | (is, expected) <- zip known (map (("line " ++) . show) [1 :: Int ..]), is /= expected]
      `shouldBe` []
    length known `shouldBe` 100000

  it "is seen at once, if its line is not complete" $ do
    (_, output) <- inTerminal $ \h seen -> withTerminal h $ \sink -> do
      sink (take 3 mission)
      putStr "name: " >> hFlush stdout
      seen "name: "
      seen "mission"
      putStrLn "Ann"
    take 2 (screen output)
      `shouldSatisfy` \shown -> take 1 shown == ["name: Ann"] && map (take 9) (drop 1 shown) == ["\9679 mission"]

  it "goes on below the tree, if its line is not complete at the end" $ do
    (_, output) <- inTerminal $ \h _ ->
      withTerminal h (\sink -> sink (take 3 mission) >> putStr "to be ") >> putStr "continued" >> hFlush stdout
    last (screen output) `shouldBe` "to be continued"

  it "is whole also without an end of the line" $ do
    (_, output) <- inTerminal $ \h _ -> withTerminal h $ \sink -> do
      sink (take 3 mission)
      putStr (replicate 300000 'x') >> hFlush stdout
      putStrLn "y"
    let shown = screen output
    [length (takeWhile (== 'x') l) | l <- shown, take 1 l == "x"] `shouldBe` [300000]
    map (take 9) (drop 1 shown) `shouldContain` ["\9679 mission"]

  it "of another process is there too" $ do
    (_, output) <- inTerminal $ \h _ -> withTerminal h $ \sink -> do
      sink (take 3 mission)
      callCommand "echo from a child"
    take 1 (screen output) `shouldBe` ["from a child"]

  it "of a tree inside is lines" $ do
    (_, output) <- inTerminal $ \h _ -> withTerminal h $ \sink -> do
      sink (take 3 mission)
      withTerminal stdout $ \inner -> inner [Began (Span 1 Top Named "inside" 7 Nothing)]
    take 1 (screen output) `shouldBe` ["7.000 + inside"]

  it "goes to the terminal again, however it ends" $ do
    (results, output) <- inTerminal $ \h _ -> do
      result <- try (withTerminal h (\sink -> sink (take 3 mission) >> throwIO (ErrorCall "lost a wheel")))
      putStrLn "after" >> hFlush stdout
      (,) result <$> mapM queryTerminal [stdOutput, stdError]
    results `shouldBe` (Left (ErrorCall "lost a wheel") :: Either ErrorCall (), [True, True])
    last (screen output) `shouldBe` "after"

  it "goes where the program sends it" . withFd $ \file -> do
    (_, output) <- inTerminal $ \h _ -> do
      withTerminal h $ \sink -> do
        sink (take 3 mission)
        void (dupTo file stdOutput)
      putStrLn "to the file" >> hFlush stdout
    screen output `shouldSatisfy` notElem "to the file"

  it "does not change how the action ends, if the terminal is closed meanwhile" $ do
    (master, slave) <- openPseudoTerminal
    h <- fdToHandle slave
    ended <- withTerm . try . withTerminal h $ \sink -> do
      sink (take 3 mission)
      closeFd master
      throwIO (ExitFailure 129)
    _ <- try (hClose h) :: IO (Either IOException ())
    ended `shouldBe` (Left (ExitFailure 129) :: Either ExitCode ())
 where
  withFd = bracket (openFile "/dev/null" WriteMode >>= handleToFd) closeFd

-- (In a chroot they may be missing.)
pseudoTerminals :: IO ()
pseudoTerminals = do
  made <- try openPseudoTerminal
  case made of
    Right (master, slave) -> closeFd master >> closeFd slave
    Left e -> pendingWith ("there are no pseudo terminals, is /dev/pts mounted? " ++ show (e :: IOException))

-- Runs the action with a handle of a terminal, which the standard output and the standard error are too; and with an
-- action that waits until this text has been written to the terminal. Gives all that has been written.
inTerminal :: (Handle -> (String -> IO ()) -> IO a) -> IO (a, Bytes.ByteString)
inTerminal act = withinAMinute $ do
  (master, slave) <- openPseudoTerminal
  written <- newTVarIO []
  ended <- newEmptyMVar
  reader <- fdToHandle master
  _ <- forkIO (collect reader written `finally` hClose reader `finally` putMVar ended ())
  h <- fdToHandle slave
  hSetEncoding h utf8
  let seen text = atomically (readTVar written >>= check . Bytes.isInfixOf (Char8.pack text) . Bytes.concat . reverse)
  a <- withTerm (redirected slave (act h seen)) `finally` hClose h
  takeMVar ended
  (,) a . Bytes.concat . reverse <$> readTVarIO written
 where
  withinAMinute run = timeout 60000000 run >>= maybe (throwIO (ErrorCall "not over after a minute")) pure
  -- (When all have closed the terminal, to read is an error.)
  collect reader written = do
    piece <- try (Bytes.hGetSome reader 4096)
    case piece of
      Right bytes | not (Bytes.null bytes) -> atomically (modifyTVar' written (bytes :)) >> collect reader written
      other -> either (\e -> let _ = e :: IOException in pure ()) (const (pure ())) other
  redirected slave run =
    bracket (flushed >> mapM dup [stdOutput, stdError]) back $ \_ -> mapM_ (dupTo slave) [stdOutput, stdError] >> run
  back saved = flushed >> forM_ (zip saved [stdOutput, stdError]) (\(s, fd) -> dupTo s fd >> closeFd s)
  flushed = hFlush stdout >> hFlush stderr

-- Runs the action with terminals of a known kind.
withTerm :: IO a -> IO a
withTerm = bracket (lookupEnv "TERM" <* setEnv "TERM" "xterm") (maybe (unsetEnv "TERM") (setEnv "TERM")) . const
