{-# LANGUAGE LambdaCase #-}

-- |
-- The robot of the tests in a browser: its page is what @test/browser/judge.py@ looks at. What it does is its first
-- argument, and then lines on its standard input; it ends when that ends.
--
-- > browser work PORT FILE     -- FILE is its own record: a trace file
-- > browser flood PORT RATE    -- RATE events a second, until the next line
-- > browser hostile PORT FILE
-- > browser secret PORT        -- its page has the token "a secret"
-- > browser open PORT          -- it would serve its page to other machines, without a token
module Main (main) where

import Control.Exception (evaluate)
import Control.Monad (forever, replicateM_, void)
import Data.Aeson (eitherDecodeStrict)
import qualified Data.ByteString.Char8 as Char8
import Data.Foldable (for_)
import Data.Time.Clock.POSIX (getPOSIXTime)
import System.Environment (getArgs)
import System.Exit (die)
import System.IO (BufferMode (..), hSetBuffering, isEOF, stdin, stdout)

import Behavior
import Behavior.Live
import Behavior.Parallel (firstOf)
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Time (every, now, sleepForever)
import Behavior.Trace (named)

main :: IO ()
main = do
  hSetBuffering stdin LineBuffering
  hSetBuffering stdout LineBuffering
  getArgs >>= \case
    ["work", port, file] -> onPage port (Just file) work
    ["flood", port, rate] -> onPage port Nothing (flood (read rate))
    ["hostile", port, file] -> onPage port (Just file) hostile
    ["secret", port] -> served loopback {pagePort = read port, pageToken = Just "a secret"} Nothing idle
    ["open", port] -> served loopback {pageHost = "0.0.0.0", pagePort = read port} Nothing idle
    _ -> die "browser: work PORT FILE, flood PORT RATE, hostile PORT FILE, secret PORT or open PORT"
 where
  idle = commanded (const Nothing) sleepForever
  onPage port = served loopback {pageRobot = "Ann", pagePort = read port}
  served page file = runBehavior . viewing defaultViewing {livePage = Just page, traceFile = file}

-- | Runs the behaviour until a line comes that is no command, or the input ends. (A command gives what it does.)
commanded :: (String -> Maybe (Behavior ())) -> Behavior () -> Behavior ()
commanded command behavior = firstOf [behavior, obeying]
 where
  obeying = do
    ends <- isEOF
    line <- if ends then pure "" else getLine
    for_ (command line) (>> obeying)

-- | An order, which is what the robot works on; and a clock: what it shows is when it was set, in milliseconds (of
-- POSIX), and a reader of the page can say how old that is.
--
-- @tick N@: sets it every N milliseconds, and not at all with 0. @order NAME@: another order.
work :: Behavior ()
work = do
  order <- newTVarIO "survey"
  period <- newTVarIO (70 :: Int)
  clock <- newTVarIO (0 :: Integer)
  let command line = case words line of
        ["tick", n] -> Just (atomically (writeTVar period (read n)))
        ["order", name] -> Just (atomically (writeTVar order name))
        _ -> Nothing
      ticking = do
        milliseconds <- atomically (readTVar period >>= \n -> n <$ check (n > 0))
        sleep (fromIntegral milliseconds / 1000)
        setTo clock
      following = Signal.switch (Signal.namedWith "order" id (Signal.watching (readTVar order))) $ \name ->
        named name (named "arm" sleepForever ||| named "wheels" sleepForever)
  commanded command . named "mission" $ firstOf [forever ticking, following, showing clock]

setTo :: TVar Integer -> Behavior ()
setTo clock = do
  time <- evaluate . round . (* 1000) =<< getPOSIXTime
  atomically (writeTVar clock time)

-- | Reacts to each value of the clock.
showing :: TVar Integer -> Behavior a
showing clock =
  Signal.switch (Signal.named "clock" (Signal.watching (readTVar clock))) (const sleepForever)

-- | Half as many steps a second as events; and the clock. At its end it prints how many events it has made: those of
-- the steps.
flood :: Int -> Behavior ()
flood rate = do
  clock <- newTVarIO 0
  made <- newTVarIO (0 :: Int)
  begun <- now
  let steps = every 0.05 $ do
        elapsed <- subtract begun <$> now
        done <- readTVarIO made
        let due = floor (elapsed * fromIntegral rate) - done
        replicateM_ (due `div` 2) (named "step" (pure ()))
        atomically (writeTVar made (done + 2 * (due `div` 2)))
  commanded (const Nothing) . named "mission" $ firstOf [steps, every 0.07 (setTo clock), showing clock]
  readTVarIO made >>= print

-- | The first line is a list of texts, in JSON: they are its names, values and failures.
hostile :: Behavior ()
hostile = do
  names <- either die pure . eitherDecodeStrict =<< Char8.getLine
  current <- newTVarIO 0
  let reacting = Signal.switch (Signal.namedWith (head names) (names !!) (Signal.watching (readTVar current))) $ \n ->
        named (names !! n) $ do
          void (named (names !! n) (failWith (names !! n))) ? pure ()
          if n + 1 < length names then atomically (writeTVar current (n + 1)) else pure ()
          sleepForever
  commanded (const Nothing) (foldr named reacting names)
