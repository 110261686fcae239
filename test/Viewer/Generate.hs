-- |
-- Random traces.
module Viewer.Generate
  ( AnyEvent (..)
  , AnyEvents (..)
  , Related (..)
  , likelyEvents
  , oddText
  , replaced
  ) where

import Data.Char (GeneralCategory (..), generalCategory)
import Data.Functor.Identity (runIdentity)
import Test.QuickCheck

import Behavior.Internal.Spans.Event (traverseTexts)
import Behavior.Time (Seconds)
import Behavior.Trace
import Viewer.Examples

-- | Any event that a file can contain: any text, any time but NaN.
newtype AnyEvent = AnyEvent Event
  deriving (Show)

instance Arbitrary AnyEvent where
  arbitrary = AnyEvent . undamaged <$> anEvent arbitrary anyTime oddText

newtype AnyEvents = AnyEvents [Event]
  deriving (Show)

instance Arbitrary AnyEvents where
  arbitrary = AnyEvents . map undamaged <$> listOf (anEvent arbitrary anyTime oddText)
  shrink (AnyEvents events) = map AnyEvents (shrinkList (const []) events)

-- The event with a number from 1, and a parent that has a smaller one.
undamaged :: Event -> Event
undamaged event = case event of
  Began s -> Began (inSpan s)
  Ended s t end -> Ended (inSpan s) t end
  Reacted r ->
    let n = from1 (reactionNumber r)
    in Reacted r {reactionNumber = n, reactionParent = below n (reactionParent r)}
  Lost n -> Lost (from1 n)
 where
  inSpan s = let n = from1 (spanNumber s) in s {spanNumber = n, spanParent = below n (spanParent s)}
  from1 n = 1 + n `mod` 1000000
  below n parent = case parent of
    Inside _ | n == 1 -> Top
    Inside p -> Inside (1 + p `mod` (n - 1))
    _ -> parent

-- | Events of few spans and reactions, at few times: so spans overlap, touch, are in each other,
-- last longer than their parents, and are stopped and started by reactions. The name of a span is
-- its number.
newtype Related = Related [Event]
  deriving (Show)

instance Arbitrary Related where
  arbitrary = do
    names <- elements [pure "x", elements ["a", "b", "c"]]
    events <- listOf (anEvent (choose (1, 20)) fewTimes names)
    pure (Related (map numbered events))
   where
    numbered (Began s) = Began (itsNumber s)
    numbered (Ended s t end) = Ended (itsNumber s) t end
    numbered event = event
    itsNumber s = s {spanName = show (spanNumber s)}
    fewTimes = (/ 4) . fromIntegral <$> choose (0, 40 :: Int)
  shrink (Related events) = map Related (shrinkList (const []) events)

anEvent :: Gen Int -> Gen Seconds -> Gen String -> Gen Event
anEvent number time text =
  frequency
    [ (2, Began <$> aSpan)
    , (6, Ended <$> aSpan <*> time <*> end)
    , (2, Reacted <$> reaction)
    , (1, Lost <$> number)
    ]
 where
  aSpan = Span <$> number <*> parent <*> elements [Named, Named, Operator, Branch] <*> text <*> time <*> perhaps number
  parent = frequency [(1, pure Top), (3, Inside <$> number), (1, pure UnknownParent)]
  end = frequency [(2, pure Succeeded), (1, FailedWith <$> text), (1, FaultedWith <$> text), (3, StoppedBy <$> cause)]
  cause =
    frequency
      [ (3, SignalChanged <$> number <*> changes)
      , (1, SiblingFinished <$> text)
      , (1, SiblingFailed <$> text)
      , (1, TimeLimit <$> time)
      , (1, FromOutside <$> text)
      , (1, pure WasAbandoned)
      ]
  changes = resize 3 (listOf (Change <$> text <*> perhaps text <*> text))
  reaction = Reaction <$> number <*> parent <*> text <*> time <*> changes <*> perhaps stopped <*> perhaps text
  stopped = StoppedBranch <$> text <*> time <*> time <*> end
  perhaps g = oneof [pure Nothing, Just <$> g]

anyTime :: Gen Seconds
anyTime =
  oneof
    [ realToFrac <$> (arbitrary :: Gen Double)
    , elements
        [0, 1 / 0, -1 / 0, 1e300, -1e300, 5e-324, 1.7976931348623157e308, 0.1 + 0.2, 1e15, 123456789.123456789, 1e-9]
    , (* 1e9) . realToFrac <$> (arbitrary :: Gen Double)
    ]

oddText :: Gen String
oddText = frequency [(3, listOf oddCharacter), (1, getUnicodeString <$> arbitrary), (1, pure "")]
 where
  oddCharacter =
    frequency
      [ (4, choose ('a', 'z'))
      , (2, choose ('\NUL', '\x9F'))
      , (1, choose ('\xD800', '\xDFFF'))
      , (1, elements "\"\\/<>&\x2028\x2029\x202E\xFEFF\xFFFD\xFFFF\x10FFFF\xE0001")
      , (1, arbitraryUnicodeChar)
      ]

-- | The event as it is read back: with U+FFFD for each surrogate.
replaced :: Event -> Event
replaced = runIdentity . traverseTexts (pure . map (\c -> if generalCategory c == Surrogate then '\xFFFD' else c))

-- | Events whose numbers and times are about right. Some parents are missing, some ends have no begin,
-- times are in any order, some texts must do no harm.
likelyEvents :: Gen [Event]
likelyEvents = sized $ \n -> do
  count <- choose (0, max 1 (n `div` 2))
  concat <$> mapM event [1 .. count]
 where
  event k = do
    s <-
      Span k
        <$> parent k
        <*> elements [minBound .. maxBound]
        <*> name
        <*> time
        <*> frequency [(4, pure Nothing), (1, Just <$> choose (1, 40))]
    took <- time
    how <- end
    r <- reaction
    elements
      [ [Began s]
      , [Began s, Ended s (spanBegan s + took) how]
      , [Ended s (spanBegan s + took) how]
      , [Reacted r]
      , [Began s, Reacted r]
      , [Lost 3]
      ]
  parent k = frequency [(5, Inside <$> choose (max 1 (k - 4), k)), (2, pure Top), (1, pure UnknownParent)]
  name = frequency [(5, elements ["drive", "look around", "open the front door", "x"]), (1, elements oddTexts)]
  time = frequency [(6, realToFrac <$> choose (0, 60 :: Double)), (1, pure 0), (1, pure 0.000001)]
  end =
    frequency
      [ (4, pure Succeeded)
      , (1, FailedWith <$> name)
      , (1, FaultedWith <$> name)
      , (2, StoppedBy <$> stop)
      ]
  stop =
    oneof
      [ SignalChanged <$> choose (1, 40) <*> changes
      , SiblingFinished <$> name
      , SiblingFailed <$> name
      , TimeLimit <$> time
      , FromOutside <$> name
      , pure WasAbandoned
      ]
  changes = resize 3 (listOf (Change <$> name <*> frequency [(1, pure Nothing), (3, Just <$> name)] <*> name))
  reaction =
    Reaction <$> choose (1, 40) <*> elements [Top, Inside 1, Inside 3] <*> name <*> time <*> changes
      <*> frequency [(1, pure Nothing), (2, Just <$> (StoppedBranch <$> name <*> time <*> time <*> end))]
      <*> frequency [(1, pure Nothing), (2, Just <$> name)]
