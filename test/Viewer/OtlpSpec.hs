{-# LANGUAGE OverloadedStrings #-}

module Viewer.OtlpSpec (spec) where

import Control.Monad (forM_)
import Data.Aeson
import qualified Data.Aeson.Key as Key
import Data.Aeson.Types (Parser, parseEither)
import qualified Data.ByteString.Lazy.Char8 as Bytes
import Data.Int (Int64)
import Data.List (group, nub, sort)
import Data.Maybe (fromMaybe, isJust)
import Data.Text (Text)
import qualified Data.Text as Text
import Data.Time.Clock (addUTCTime)
import Test.Hspec
import Test.QuickCheck

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.File
import Behavior.Trace.Otlp
import Behavior.Trace.Recording
import Support (sampling)
import Viewer.Examples
import Viewer.Generate
import Viewer.Golden

spec :: Spec
spec = do
  describe "of a mission" (golden "mission-otlp.json" (render mission))
  describe "with all kinds of events" (golden "detailed-otlp.json" (render detailed))
  it "is one line" $ Bytes.elemIndices '\n' (render mission) `shouldBe` [Bytes.length (render mission) - 1]
  sampling 1000 . it "has each span once, in its parent, with its own times" . property $ \(Related events) ->
    let r = recording events
        expected parent n = (name n, parent, began n, max (began n) (time (nodeUntil r n))) : inside n
        inside n = concatMap (expected (Just (name n))) (nodeChildren n)
        began = time . spanBegan . nodeSpan
        name = Text.pack . nameText . spanName . nodeSpan
        found spans = [(sName s, sParent s >>= (`lookup` names), sBegin s, sEnd s) | s <- spans, isSpan s]
         where
          names = [(sId s, sName s) | s <- spans]
    in fmap (sort . found) (parsed (render events)) === Right (sort (concatMap (expected Nothing) (recordingRoots r)))
  it "has identifiers as receivers demand, and no two are equal" . property $ \(Related events) ->
    let isIdentifier n t = Text.length t == n && Text.all (`elem` digits) t && Text.any (/= '0') t
        digits = "0123456789abcdef" :: String
    in case parsed (render events) of
        Left why -> counterexample why False
        Right spans ->
          conjoin
            [ property (all (isIdentifier 32 . sTrace) spans && all (isIdentifier 16 . sId) spans)
            , property (length (nub (map sTrace spans)) <= 1)
            , repeated (map sId (filter isSpan spans)) === []
            ]
  it "has the same identifiers each time, and others for another run" $ do
    let later = Header (addUTCTime 0.000001 (zeroTime header))
        identifiers zero =
          either error (map (\s -> (sTrace s, sId s))) (parsed (renderOtlp "Ann" zero (recording mission)))
        (here, there) = (identifiers header, identifiers later)
    identifiers header `shouldBe` here
    filter (`elem` map fst there) (map fst here) `shouldBe` []
    filter (`elem` map snd there) (map snd here) `shouldBe` []
  it "can be read, with each key once, whatever the times and texts are" . property $ \(AnyEvents events) ->
    let keys s = map (map fst) (sAttributes s : map snd (sEvents s))
    in fmap (concatMap (concatMap repeated . keys)) (parsed (render events)) === Right []
  it "has an error and its text where a span failed or faulted, and nowhere else" $
    fmap (\spans -> [(sName s, sStatus s) | s <- spans, isJust (sStatus s)]) (parsed (render mission))
      `shouldBe` Right
        [ ("front door", Just (2, "locked"))
        , ("photograph the north wall", Just (2, "camera: no such device"))
        ]
  it "shows what has not ended until the end of the recording, and says so" $
    fmap (\spans -> [(sEnd s, sAttributes s `has` "behavior.outcome") | s <- spans, sName s == "radio"])
      (parsed (render mission))
      `shouldBe` Right [(time 40, Just "not ended")]
  it "says why a span was stopped" $
    fmap (\spans -> [filter (Text.isPrefixOf "behavior.s" . fst) (sAttributes s) | s <- spans, sName s == "survey"])
      (parsed (render mission))
      `shouldBe` Right
        [ [ ("behavior.stopped.text", "battery 9.4 (was 100) -> batteryLow True (was False)")
          , ("behavior.stopped.why", "signal")
          , ("behavior.stopped.reaction", "8")
          , ("behavior.signal.battery.before", "100")
          , ("behavior.signal.battery.after", "9.4")
          , ("behavior.signal.batteryLow.before", "False")
          , ("behavior.signal.batteryLow.after", "True")
          ]
        , [("behavior.started_by", "11")]
        ]
  it "has each reaction as an event of the span in which its operator runs" $ do
    let found = either error id (parsed (render mission))
    [(sName s, t) | s <- found, (t, _) <- sEvents s] `shouldBe` [("mission", time 9.1), ("mission", time 28)]
    [e `has` "behavior.starts" | s <- found, (_, e) <- sEvents s] `shouldBe` [Just "recovery", Just "task"]
  it "has a reaction in no span that is known as a span of its own" $
    forM_ [Top, UnknownParent, Inside 3] $ \parent -> do
      let events = [Reacted (Reaction 4 parent "monitor" 2 [Change "door" Nothing "open"] Nothing Nothing)]
      fmap (map (\s -> (sName s, sParent s, sBegin s, sEnd s, sAttributes s `has` "behavior.kind")))
        (parsed (render events))
        `shouldBe` Right [("monitor", Nothing, time 2, time 2, Just "reaction")]
  it "has a link from each span that a reaction started to the first one that it stopped" $ do
    let low = StoppedBy (SignalChanged 9 [])
        stopped = ended 1 Top "a" 0 Nothing 1 low ++ ended 4 (Inside 1) "d" 0 Nothing 1 low
        started = ended 2 Top "b" 1 (Just 9) 2 Succeeded ++ ended 3 Top "c" 1 (Just 9) 2 Succeeded
        links events = fmap (\spans -> [(sName s, l) | s <- spans, l <- stoppedOf spans s]) (parsed (render events))
        stoppedOf spans s = [sName t | l <- sLinks s, t <- spans, sId t == l]
    links (stopped ++ started) `shouldBe` Right [("b", "a"), ("c", "a")]
    links started `shouldBe` Right []
    links stopped `shouldBe` Right []
  it "says of a span whose parent is unknown that it is" $
    fmap (\spans -> [sName s | s <- spans, sAttributes s `has` "behavior.parent" == Just "unknown"])
      (parsed (render (ended 2 (Inside 1) "lost" 0 Nothing 1 Succeeded ++ mission)))
      `shouldBe` Right ["radio"]
  it "distinguishes signals of the same name" $ do
    let changes = [Change "door" (Just "shut") "open", Change "door" Nothing "shut"]
        events = ended 1 Top "a" 0 Nothing 1 (StoppedBy (SignalChanged 2 changes))
    fmap (map (filter (Text.isPrefixOf "behavior.signal" . fst) . sAttributes)) (parsed (render events))
      `shouldBe` Right
        [ [ ("behavior.signal.door.before", "shut")
          , ("behavior.signal.door.after", "open")
          , ("behavior.signal.door 2.after", "shut")
          ]
        ]
  it "has the name of the service, and how many events were lost" $
    fmap fst (request (render mission))
      `shouldBe` Right [("service.name", "Ann"), ("behavior.lost", "2")]
  it "is made of nothing, too" $ parsed (render []) `shouldBe` Right []
 where
  render = renderOtlp "Ann" header . recording
  isSpan s = sAttributes s `has` "behavior.kind" /= Just "reaction"
  has known key = lookup key (known :: [(Text, Text)])
  repeated xs = [x | x : _ : _ <- group (sort xs)]

-- In nanoseconds since 1970, of a time of the file with the header.
time :: Seconds -> Int64
time t = 1769860800000000000 + round (max (-4e9) (min 4e9 t) * 1e9)

-- * What a reader finds

data Found = Found
  { sTrace :: Text
  , sId :: Text
  , sParent :: Maybe Text
  , sName :: Text
  , sBegin :: Int64
  , sEnd :: Int64
  , sStatus :: Maybe (Int, Text)
  , sAttributes :: [(Text, Text)]
  , sEvents :: [(Int64, [(Text, Text)])]
  , sLinks :: [Text]
  }
  deriving (Eq, Show)

parsed :: Bytes.ByteString -> Either String [Found]
parsed = fmap snd . request

-- | The attributes of the resource, and the spans.
request :: Bytes.ByteString -> Either String ([(Text, Text)], [Found])
request content = eitherDecode content >>= parseEither whole
 where
  whole o = o .: "resourceSpans" >>= only >>= \r -> do
    about <- r .: "resource" >>= attributes
    found <- r .: "scopeSpans" >>= only >>= (.: "spans") >>= traverse aSpan
    pure (about, found)
  only :: [Object] -> Parser Object
  only [o] = pure o
  only others = fail ("one is expected, not " ++ show (length others))

aSpan :: Object -> Parser Found
aSpan o = do
  status <- o .:? "status"
  Found
    <$> o .: "traceId"
    <*> o .: "spanId"
    <*> o .:? "parentSpanId"
    <*> o .: "name"
    <*> nanoseconds o "startTimeUnixNano"
    <*> nanoseconds o "endTimeUnixNano"
    <*> traverse (\s -> (,) <$> s .: "code" <*> s .: "message") (status :: Maybe Object)
    <*> attributes o
    <*> (listed "events" >>= traverse (\e -> (,) <$> nanoseconds e "timeUnixNano" <*> attributes e))
    <*> (listed "links" >>= traverse (.: "spanId"))
 where
  listed key = fromMaybe [] <$> o .:? key :: Parser [Object]

nanoseconds :: Object -> Text -> Parser Int64
nanoseconds o key = read <$> o .: Key.fromText key

attributes :: Object -> Parser [(Text, Text)]
attributes o = o .: "attributes" >>= traverse one
 where
  one :: Object -> Parser (Text, Text)
  one a = (,) <$> a .: "key" <*> (a .: "value" >>= value)
  value :: Object -> Parser Text
  value v = v .:? "stringValue" >>= maybe (v .:? "intValue" >>= maybe (shown <$> v .: "doubleValue") pure) pure
  shown :: Value -> Text
  shown = Text.pack . show
