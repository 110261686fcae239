{-# LANGUAGE OverloadedStrings #-}

module Viewer.TraceEventsSpec (spec) where

import Control.Monad (forM_)
import Data.Aeson hiding (pairs)
import qualified Data.Aeson.KeyMap as KeyMap
import Data.Aeson.Types (Parser, parseEither)
import qualified Data.ByteString as Strict
import qualified Data.ByteString.Lazy as Bytes
import Data.List (group, nub, sort, tails)
import qualified Data.Map.Strict as Map
import Data.Scientific (Scientific)
import Data.Text (Text)
import qualified Data.Text as Text
import Test.Hspec
import Test.QuickCheck

import Behavior.Trace
import Behavior.Trace.Recording
import Behavior.Trace.TraceEvents
import Support (sampling)
import Viewer.Examples
import Viewer.Generate
import Viewer.Golden

spec :: Spec
spec = do
  describe "of a mission" (golden "mission-trace-events.json" (render mission))
  describe "with all kinds of events" (golden "detailed-trace-events.json" (render detailed))
  sampling 1000 . it "has lanes that nest and flows with both ends" . property $ \(Related events) ->
    checked (render events) === []
  it "has them with any times and texts" . property $ \(AnyEvents events) -> checked (render events) === []
  it "has each span once, with its own times" . property $ \(Related events) ->
    let r = recording events
        times n =
          let began = spanBegan (nodeSpan n)
          in (name n, micro (began - begin r), micro (max began (nodeUntil r n) - begin r))
        micro t = realToFrac t * 1000000
        -- One nanosecond later for each begin and end before, at most.
        near (n, b, e) (m, b', e') =
          n == m && all (\d -> d >= 0 && d * 500 <= fromIntegral (length (nodes r))) [b' - b, e' - e]
    in case parsed (render events) of
        Left why -> counterexample why False
        Right (spans, _) ->
          let found = sort [(sName c, sBegin c, sEnd c) | c <- spans]
              expected = sort (map times (nodes r))
          in counterexample
              (show (expected, found))
              (length found == length expected && and (zipWith near expected found))
  sampling 1000 . it "has a span on a lane inside those only that it really ran in" . property $
    \(Related events) ->
      let r = recording events
          outer = Map.fromList (concatMap (surround []) (recordingRoots r))
          surround above n = (name n, above) : concatMap (surround (name n : above)) (nodeChildren n)
          strangers spans =
            [ (a, b)
            | (a, b) <- pairs spans
            , sLane a == sLane b
            , overlapping a b
            , sName b `notElem` outer Map.! sName a
            , sName a `notElem` outer Map.! sName b
            ]
      in fmap (strangers . fst) (parsed (render events)) === Right []
  it "has one lane for what runs one after the other" $
    fmap (nub . map sLane . fst) (parsed (render (filter (not . radio) mission))) `shouldBe` Right [1]
  it "has a flow from what was stopped to what was started" $
    fmap (map (\f -> (fPhase f, fTime f)) . snd) (parsed (render mission))
      `shouldBe` Right [("s", 9100000), ("f", 9400000.002)]
  it "has a flow for each span that a reaction started, if it stopped one" $ do
    let low = StoppedBy (SignalChanged 9 [])
        stopped = ended 1 Top "a" 0 Nothing 1 low
        started = ended 2 Top "b" 1 (Just 9) 2 Succeeded ++ ended 3 Top "c" 1 (Just 9) 2 Succeeded
    fmap (length . snd) (parsed (render (stopped ++ started))) `shouldBe` Right 4
    fmap (length . snd) (parsed (render started)) `shouldBe` Right 0
    fmap (length . snd) (parsed (render stopped)) `shouldBe` Right 0
  it "has a flow that leaves a span before its instant event" $ do
    let made =
          render
            ( ended 1 Top "a" 0 Nothing 1 (StoppedBy (SignalChanged 9 []))
                ++ ended 2 Top "b" 1 (Just 9) 2 Succeeded
            )
    fmap (map fTime . take 1 . snd) (parsed made) `shouldBe` Right [999999.998]
    fmap (map (\(_, t, _) -> t)) (reasons made) `shouldBe` Right [999999.999]
  it "marks what has not ended, and shows it until the end of the recording" $
    fmap (\s -> [(sEnd c, sOutcome c) | c <- fst s, sName c == "radio"]) (parsed (render mission))
      `shouldBe` Right [(40000000, "not ended")]
  it "has what begins when the span around it ends inside of that span" $ do
    let spans =
          ended 1 Top "outer" 0 Nothing 1 Succeeded
            ++ concat [ended n (Inside 1) "inner" t Nothing t Succeeded | (n, t) <- [(2, 0), (3, 1), (4, 1)]]
    fmap (\s -> [(sName c, sBegin c, sEnd c) | c <- fst s]) (parsed (render spans))
      `shouldBe` Right
        [ ("outer", 0, 1000000.004)
        , ("inner", 0.001, 0.002)
        , ("inner", 1000000, 1000000.001)
        , ("inner", 1000000.002, 1000000.003)
        ]
  it "has the arrow of a reaction without an escape, which a viewer shows" $
    Bytes.toStrict (render mission) `shouldSatisfy` ("battery 9.4 (was 100) -> batteryLow" `Strict.isInfixOf`)
  it "has no arguments, which would become part of the names" . property $ \(AnyEvents events) ->
    fmap (filter sArguments . fst) (parsed (render events)) === Right []
  it "has why a span failed or was stopped, in the span, just before its end" $
    fmap (map (\(l, t, why) -> (l, t, Text.takeWhile (/= ':') why))) (reasons (render mission))
      `shouldBe` Right
        [ (1, 2399999.999, "failed")
        , (1, 9400000, "stopped")
        , (1, 9399999.999, "stopped")
        , (1, 30999999.999, "faulted")
        ]
  it "is made of ten thousand spans at the same time, and of as many in each other" $ do
    let size events = length (either (const []) fst (parsed (render events)))
    size (concat [ended n Top "x" (fromIntegral n) Nothing 20000 Succeeded | n <- [1 .. 10000]]) `shouldBe` 10000
    size (concat [ended n (Inside (n - 1)) "x" 0 Nothing 1 Succeeded | n <- [1 .. 10000]]) `shouldBe` 10000

  describe "is checked by a checker that" $ do
    it "finds lanes that overlap" $ checked (file [x 1 0 10, x 1 5 10]) `shouldSatisfy` any (Text.isInfixOf "overlap")
    it "finds equal times" $
      forM_ [[x 1 0 10, x 1 0 4], [x 1 0 10, x 1 4 6], [x 1 0 10, x 1 10 1], [x 1 4 0]] $ \spans ->
        checked (file spans) `shouldSatisfy` any (Text.isInfixOf "equal times")
    it "allows what is in the other, and what follows it" $
      checked (file [x 1 0 10, x 1 1 3, x 1 5 4, x 1 11 1, x 2 5 10]) `shouldBe` []
    it "finds flows without an end, or without a beginning" $
      forM_ ["s", "f"] $ \phase ->
        checked (file [x 1 0 10, flow phase 1 1 5]) `shouldSatisfy` any (Text.isInfixOf "both ends")
    it "finds flows that begin or end outside of every span" $
      checked (file [x 1 0 10, flow "s" 1 1 5, flow "f" 1 2 6]) `shouldSatisfy` any (Text.isInfixOf "outside")
    it "finds flows that lead back in time" $
      checked (file [x 1 0 10, flow "s" 1 1 5, flow "f" 1 1 4]) `shouldSatisfy` any (Text.isInfixOf "back")
    it "allows a flow from span to span" $
      checked (file [x 1 0 10, x 2 6 3, flow "s" 1 1 5, flow "f" 1 2 6]) `shouldBe` []
    it "finds what is no JSON" $ checked "{" `shouldSatisfy` not . null
 where
  render = renderTraceEvents . recording
  begin Recording {recordingFrom = t} = t
  name = Text.pack . spanName . nodeSpan
  radio event = case event of
    Began s -> spanName s == "radio"
    _ -> False
  file events = encode (object ["traceEvents" .= (events :: [Value])])
  x :: Int -> Int -> Int -> Value
  x tid ts dur =
    object
      [ "ph" .= ("X" :: Text)
      , "pid" .= (1 :: Int)
      , "tid" .= tid
      , "ts" .= ts
      , "dur" .= dur
      , "name" .= ("x" :: Text)
      , "cat" .= ("named,succeeded" :: Text)
      ]
  flow :: Text -> Int -> Int -> Int -> Value
  flow phase i tid ts = object ["ph" .= phase, "pid" .= (1 :: Int), "id" .= i, "tid" .= tid, "ts" .= ts]

-- * The checker

data Complete = Complete
  { sLane :: Int
  , sBegin :: Scientific
  , sEnd :: Scientific
  , sName :: Text
  , sOutcome :: Text
  , sArguments :: Bool
  }
  deriving (Eq, Show)

data Flow = Flow
  { fPhase :: Text
  , fId :: Int
  , fLane :: Int
  , fTime :: Scientific
  }
  deriving (Eq, Show)

-- | What is wrong with the file.
checked :: Bytes.ByteString -> [Text]
checked content = case parsed content of
  Left why -> ["no trace-event file: " <> Text.pack why]
  Right (spans, flows) ->
    [ "spans overlap: " <> shown (a, b)
    | (a, b) <- pairs spans
    , sLane a == sLane b
    , not (apart a b || inside a b || inside b a)
    ]
      ++ [ "equal times: " <> shown t
         | t : _ : _ <- group (sort (concat [[(sLane s, sBegin s), (sLane s, sEnd s)] | s <- spans]))
         ]
      ++ concatMap (flowProblems spans) (Map.toList (Map.fromListWith (flip (++)) [(fId f, [f]) | f <- flows]))
 where
  apart a b = sEnd a <= sBegin b || sEnd b <= sBegin a
  inside a b = sBegin b <= sBegin a && sEnd a <= sEnd b

flowProblems :: [Complete] -> (Int, [Flow]) -> [Text]
flowProblems spans (_, found) = case found of
  [s, f]
    | (fPhase s, fPhase f) /= ("s", "f") -> ["a flow without both ends: " <> shown found]
    | fTime f < fTime s -> ["a flow leads back: " <> shown found]
    | not (all inSpan found) -> ["a flow is outside of every span: " <> shown found]
    | otherwise -> []
  _ -> ["a flow without both ends: " <> shown found]
 where
  inSpan f = any (\s -> sLane s == fLane f && sBegin s <= fTime f && reaches (fTime f) s) spans
  reaches t s = t < sEnd s || sBegin s == sEnd s && t == sEnd s

parsed :: Bytes.ByteString -> Either String ([Complete], [Flow])
parsed content =
  eitherDecode content
    >>= parseEither (withObject "file" (\o -> o .: "traceEvents" >>= fmap mconcat . traverse entry))

-- | The lanes, times and names of the instant events.
reasons :: Bytes.ByteString -> Either String [(Int, Scientific, Text)]
reasons content = eitherDecode content >>= parseEither (withObject "file" (\o -> o .: "traceEvents" >>= inAll))
 where
  inAll events = concat <$> traverse instant (events :: [Object])
  instant :: Object -> Parser [(Int, Scientific, Text)]
  instant o = do
    phase <- o .: "ph"
    if phase == ("i" :: Text) then (\l t why -> [(l, t, why)]) <$> o .: "tid" <*> o .: "ts" <*> o .: "name" else pure []

entry :: Object -> Parser ([Complete], [Flow])
entry o = do
  phase <- o .: "ph"
  case phase :: Text of
    "X" -> do
      begin <- o .: "ts"
      lasts <- o .: "dur"
      categories <- Text.splitOn "," <$> o .: "cat"
      s <-
        Complete
          <$> o .: "tid"
          <*> pure begin
          <*> pure (begin + lasts)
          <*> o .: "name"
          <*> pure (last categories)
          <*> pure (KeyMap.member "args" o)
      if lasts < 0 then fail "negative duration" else pure ([s], [])
    _ | phase `elem` ["M", "i"] -> pure ([], [])
    _ | phase `elem` ["s", "f"] -> (\f -> ([], [f])) <$> (Flow phase <$> o .: "id" <*> o .: "tid" <*> o .: "ts")
    _ -> fail ("phase " ++ Text.unpack phase)

pairs :: [a] -> [(a, a)]
pairs xs = [(x, y) | x : ys <- tails xs, y <- ys]

-- With an interval that both of them contain.
overlapping :: Complete -> Complete -> Bool
overlapping a b = max (sBegin a) (sBegin b) < min (sEnd a) (sEnd b)

shown :: Show a => a -> Text
shown = Text.pack . show
