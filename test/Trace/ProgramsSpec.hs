{-# LANGUAGE LambdaCase #-}

-- |
-- The traces of random programs, each simulated under a random schedule.
module Trace.ProgramsSpec
  ( spec
  , tracedRight
  , wrongly
  , smallest
  , sinksChangeNothing
  ) where

import Control.Concurrent.MVar (newEmptyMVar, readMVar, tryPutMVar)
import Control.Exception (ErrorCall (..), finally, throwIO)
import Control.Monad (void)
import Data.Foldable (for_)
import Data.IORef
import GHC.Conc (getUncaughtExceptionHandler, setUncaughtExceptionHandler)
import Test.Hspec
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck

import Behavior.Sim (Schedule (..))
import qualified Behavior.Sim as Sim
import Behavior.Trace (Sink (..), TraceOptions (..), defaultTraceOptions, withTrace, withTraceOptions)
import qualified Language.Operator as O
import Semantics.Generate (shrinkWorld, worlds)
import Semantics.Path (Seen (end), Verdict (..), everything, explains)
import Semantics.Program
import Support (leavingNothing, sampling)
import Trace.Recorder (Record (seen, whole), entries, recordedRun)
import Trace.Rules

-- | Each simulation has its own watchdog.
spec :: Spec
spec = around_ leavingNothing $ do
  sampling 200 $
    prop "are what the programs did" tracedRight
  it "are what the programs did, in rare situations under many schedules" $
    for_ rareWorlds $ \w -> for_ [1 .. 150] $ \seed -> wrongly seed w `shouldReturn` []
  sampling 100 $
    prop "are equal for equal seeds, and change no run, with and without sinks" sinksChangeNothing

-- | A random program, under a random schedule. (A behaviour that was abandoned has no spans any more; what a rule
-- for messages shows, "Trace.MessagesSpec" says.)
tracedRight :: Property
tracedRight =
  forAllBlind ((,) <$> worlds traced 4 <*> arbitrary) $ \(w, seed) -> ioProperty $ do
    found <- wrongly seed w
    message <- if null found then pure "" else smallest seed w
    pure (counterexample message (null found))
 where
  traced = \case
    O.MessageRule {} -> False
    o -> not (O.abandons o)

-- | Worlds for situations that random worlds rarely have.
rareWorlds :: [World]
rareWorlds =
  [ -- The operator is cancelled while it reads again, after its reaction has stopped a branch.
    ( world
        ( TeleoReactive
            [ (Watched "q", act "a" 1 (Succeeds 0))
            , (Polled 3 (act "s" 2 (Succeeds 2)), act "b" 1 (Succeeds 0))
            ]
        )
    )
      { changes = [Change 2 "q" (At 2)]
      , cancelAt = 1
      }
  , ( world
        ( InsteadWhen
            (Watched "p")
            (act "a" 1 (Succeeds 0))
            ( RSelect
                (Polled 2 (Do "s" [script 1 (Succeeds 1), script 0 (Succeeds 0)]))
                (act "b" 9 (Succeeds 0))
                (act "c" 1 (Succeeds 0))
            )
        )
    )
      { cancelAt = 3
      , caller = PlainThread Synchronous 0
      }
  , -- It is cancelled while it stops the sensors, before the recovery.
    ( world
        ( Both
            (Timeout 3 (act "a" 0 Fails))
            (InsteadWhen (Debounce 2 (Watched "q")) (act "b" 1 (Succeeds 0)) (act "c" 1 (Succeeds 0)))
        )
    )
      { conditions = [("p", At 0), ("q", At 1)]
      }
  , -- A branch completes although its stop was requested.
    ( world
        ( RSelect
            (Hysteresis False 0 2 (Watched "p"))
            (act "a" 9 (Succeeds 0))
            (Do "b" [(script 9 (Succeeds 0)) {onStop = EndsAfter 1 (Succeeds 1)}])
        )
    )
      { changes = [Change 1 "p" (At 2)]
      }
  , -- The condition changes, and changes back.
    (world (RSelect (Watched "p") (act "a" 9 (Succeeds 0)) (act "b" 9 (Succeeds 0))))
      { changes = [Change 1 "p" (At 1), Change 1 "p" (At 0), Change 2 "p" (At 1)]
      }
  , (world (Monitor (Watched "p") (act "a" 1 (Succeeds 0)) (act "b" 9 (Succeeds 0))))
      { changes = [Change 1 "p" (At 1), Change 1 "p" (At 0)]
      }
  , -- The sensor decides, and at the same time the other condition changes.
    ( world
        ( Monitor
            (And (Polled 2 (Do "s" [script 0 (Succeeds 0), script 0 (Succeeds 1)])) (Watched "p"))
            (act "a" 1 (Succeeds 0))
            (act "b" 9 (Succeeds 0))
        )
    )
      { conditions = [("p", At 1), ("q", At 0)]
      , changes = [Change 2 "p" (At 0)]
      }
  , -- Two branches fail, or end, at the same time.
    world $
      Both (act "a" 1 Fails) (act "b" 1 Fails `Then` act "c" 1 Fails)
        `Else` Parallel (act "d" 1 (Succeeds 0)) (act "e" 1 Fails)
  , world $
      AllOf [act "a" 2 (Succeeds 0), act "b" 1 Fails, act "c" 3 (Succeeds 0)]
        `Else` FirstOf [act "d" 2 Fails, act "e" 1 (Succeeds 0)]
  ]
 where
  world p =
    World
      { conditions = [("p", At 0), ("q", At 0)]
      , changes = []
      , cancelAt = 9
      , program = p
      , caller = Operator
      , slippage = 0
      }
  act name n how = Do name [script n how]
  script n how = Script n how Unmasked StopsAtOnce

-- | What is wrong with the run of this world under that schedule.
wrongly :: Int -> World -> IO [String]
wrongly seed w = do
  record <- recordedRun id seed (Seeded seed) w
  pure $ case seen record of
    Left why -> [why]
    Right s -> mistakes record ++ case explains 4000 everything w s of
      Impossible rest instead -> ["not allowed by the specification: " ++ show (rest, instead)]
      ImpossibleEnd instead -> ["no end of the specification: " ++ show (end s, instead)]
      _ -> []

-- | The smallest program that is found, and what is wrong with it.
smallest :: Int -> World -> IO String
smallest seed w = wrongs w >>= maybe (pure "not found again") (go w)
 where
  go small how = firstJust (map wrongs (shrinkWorld small)) (shrinkWorld small) >>= maybe (told small how) (uncurry go)
  wrongs = firstIn [seed, 1, 2, 3, 4, 5, 6, 7, 8]
  firstIn [] _ = pure Nothing
  firstIn (k : ks) small = wrongly k small >>= \found -> if null found then firstIn ks small else pure (Just (k, found))
  firstJust (act : acts) (small : others) = act >>= maybe (firstJust acts others) (pure . Just . (,) small)
  firstJust _ _ = pure Nothing
  told small (k, found) = do
    record <- recordedRun id k (Seeded k) small
    pure (unlines (show small : ("under schedule " ++ show k) : found ++ map show (entries record)))

-- | Equal seeds give equal runs, whatever sinks there are: one that is blocked as long as the program
-- runs, one that throws, and one that keeps what it receives.
sinksChangeNothing :: Property
sinksChangeNothing =
  forAllBlind ((,) <$> worlds (const True) 4 <*> arbitrary) $ \(w, seed) -> ioProperty $ do
    gate <- newIORef =<< newEmptyMVar
    kept <- newIORef []
    let open = readIORef gate >>= \g -> void (tryPutMVar g ())
        blocked = EachEvent (\_ -> readIORef gate >>= readMVar)
        throwing = EachEvent (\_ -> throwIO (ErrorCall "this sink throws"))
        keeping = Batches (\batch -> modifyIORef' kept (reverse batch ++))
        options = defaultTraceOptions {withOperators = True, waitAtEnd = 5}
        runs wrapped = whole <$> recordedRun (wrapped . (`finally` open)) seed (Seeded seed) w
        same name (a, b) = counterexample (name ++ ": " ++ show a ++ "\n" ++ show b) (a == b)
        equal name a b =
          conjoin
            [ same (name ++ ", steps") (show (Sim.steps a), show (Sim.steps b))
            , same (name ++ ", points") (Sim.runPoints a, Sim.runPoints b)
            , same (name ++ ", schedule") (Sim.runSchedule a, Sim.runSchedule b)
            , same (name ++ ", time") (Sim.finished a, Sim.finished b)
            , same (name ++ ", end") (Sim.explain (Sim.outcome a), Sim.explain (Sim.outcome b))
            , same (name ++ ", events") (Sim.events a, Sim.events b)
            ]
    first <- runs id
    second <- runs id
    without <- runs (withTrace [])
    newEmptyMVar >>= writeIORef gate
    with <- unreported (runs (withTraceOptions options [blocked, throwing, keeping]))
    received <- reverse <$> readIORef kept
    -- What a run that was cut off does when it is unwound is not among its events.
    let begins = take (length (Sim.events with)) received
    pure . counterexample (show w ++ "\nunder schedule " ++ show seed) $
      conjoin
        [ equal "again" first second
        , equal "without sinks" first without
        , equal "with sinks" first with
        , same "received" (begins, Sim.events with)
        ]

-- | What becomes of sinks is not printed.
unreported :: IO a -> IO a
unreported act = do
  usual <- getUncaughtExceptionHandler
  setUncaughtExceptionHandler (const (pure ()))
  act `finally` setUncaughtExceptionHandler usual
