{-# LANGUAGE RebindableSyntax #-}

-- |
-- "Behavior.Paper" itself: its overloaded syntax, on behaviours and on ordinary values.
module Paper.SyntaxSpec (spec) where

import Control.Concurrent.STM (TVar, modifyTVar', newTVarIO, readTVarIO, writeTVar)
import Test.Hspec

import Behavior.Paper
import Behavior.STM (atomically)
import Support (Ending (..), Fault (..), ending, guarded, hang)

spec :: Spec
spec = guarded $ do
  describe "if" $ do
    it "chooses by a Bool, between values of any type" $
      [if True then 'y' else 'n', if False then 'y' else 'n'] `shouldBe` "yn"
    it "chooses by a behaviour, between behaviours" $ do
      (if return True then return 'y' else return 'n') `shouldReturn` 'y'
      (if return False then return 'y' else return 'n') `shouldReturn` 'n'
    it "runs its condition once, first" $
      logging (\note -> if note "test" >> return True then note "yes" else note "no")
        `shouldReturn` (Gave (), ["test", "yes"])
    it "runs nothing else when its condition fails or faults" $ do
      logging (\note -> if failing then note "yes" else note "no") `shouldReturn` (failure, [])
      logging (\note -> if faulting then note "yes" else note "no") `shouldReturn` (fault, [])
  describe "unless" $ do
    it "runs the behaviour when the Bool is false" $
      logging (\note -> unless False (note "a") >> unless True (note "b"))
        `shouldReturn` (Gave (), ["a"])
    it "runs the behaviour when the condition is false" $
      logging (\note -> unless (return False) (note "a") >> unless (return True) (note "b"))
        `shouldReturn` (Gave (), ["a"])
    it "runs nothing when the condition fails or faults" $ do
      logging (\note -> unless failing (note "a")) `shouldReturn` (failure, [])
      logging (\note -> unless faulting (note "a")) `shouldReturn` (fault, [])
  describe "not" $ do
    it "on a Bool is the Prelude's not" $
      map not [False, True] `shouldBe` [True, False]
    it "is the opposite of a condition" $ do
      not (return False) `shouldReturn` True
      not (return True) `shouldReturn` False
    it "of a condition that fails or faults throws the same" $ do
      ending (not failing) `shouldReturn` failure
      ending (not faulting) `shouldReturn` fault
  describe "&" $ do
    it "on Bool is &&" $
      [l & r | l <- [False, True], r <- [False, True]] `shouldBe` [False, False, False, True]
    it "is true when both conditions are true" $
      mapM (\(l, r) -> return l & return r) [(False, False), (False, True), (True, False), (True, True)]
        `shouldReturn` [False, False, False, True]
    it "tests the second only if the first is true" $ do
      (return False & faulting) `shouldReturn` False
      ending (return True & faulting) `shouldReturn` fault
      ending (failing & faulting) `shouldReturn` failure
    it "binds looser than > and ==" $
      (1 == one & two > 1) `shouldBe` True
  describe ">" $ do
    it "compares values of one type" $ do
      (two > 1, one > 1) `shouldBe` (True, False)
      ("b" > "a", (1.5 :: Double) > 2) `shouldBe` (True, False)
    it "makes a condition of a behaviour and a value" $ do
      ((return two :: Behavior Int) > 1) `shouldReturn` True
      ((return one :: Behavior Int) > 1) `shouldReturn` False
    it "can be a section" $
      filter (> one) [one, two] `shouldBe` [two]
    it "of a behaviour that fails or faults throws the same" $ do
      ending ((failed :: Behavior Int) > 1) `shouldReturn` FailedWith (show Failed)
      ending ((throwing :: Behavior Int) > 1) `shouldReturn` fault
  describe "fallback" $ do
    it "takes two behaviours" $ do
      fallback (return 'a' :: Behavior Char) (return 'b') `shouldReturn` 'a'
      fallback (failed :: Behavior Char) (return 'b') `shouldReturn` 'b'
      ending (fallback (throwing :: Behavior Char) (return 'b')) `shouldReturn` fault
    it "takes a list and a function" $ do
      fallback [1, 2, 3 :: Int] (\n -> if n > 1 then return n else failed) `shouldReturn` 2
      ending (fallback "ab" (\door -> failWith [door] :: Behavior ()))
        `shouldReturn` FailedWith (show (FailedBecause "b"))
      ending (fallback "" return) `shouldReturn` FailedWith (show Failed)
      ending (fallback "ab" (\_ -> throwing :: Behavior ())) `shouldReturn` fault
  describe "attempt" $ do
    it "tries a behaviour" $
      logging (\note -> attempt 3 (note "try" >> failed)) `shouldReturn` (gaveUp, ["try", "try", "try"])
    it "tries a behaviour that takes arguments, with the same arguments" $
      logging (\note -> attempt 2 (\x y -> note (x ++ y) >> failed) "a" "b")
        `shouldReturn` (gaveUp, ["ab", "ab"])
    it "tries nothing for zero or a negative number" $ do
      logging (\note -> attempt 0 note "try") `shouldReturn` (gaveUp, [])
      logging (\note -> attempt (-1) (note "try")) `shouldReturn` (gaveUp, [])
    it "is attemptNTimes" $
      logging (\note -> attemptNTimes 2 (\x -> note x >> failed) "try")
        `shouldReturn` (gaveUp, ["try", "try"])
  describe "rSelect" $ do
    it "can be given a Bool" $ do
      rSelect True (return 'l') (return 'r') `shouldReturn` 'l'
      rSelect False (return 'l') (return 'r') `shouldReturn` 'r'
    it "switches when its condition changes" $ do
      state <- newTVarIO False
      rSelect (not (readTVarIO state)) (write state True >> hang) (return 'r') `shouldReturn` 'r'
    it "fails or faults when its condition does" $ do
      logging (\note -> rSelect failing (note "l") (note "r")) `shouldReturn` (failure, [])
      logging (\note -> rSelect faulting (note "l") (note "r")) `shouldReturn` (fault, [])
  describe "monitor" $ do
    it "can be given a Bool" $
      monitor False (return ()) (return 't') `shouldReturn` 't'
    it "recovers when its condition becomes true" $ do
      level <- newTVarIO two
      monitor (fmap negate (readTVarIO level) > (-2)) (write level 3)
        (readTVarIO level >>= \n -> if n > 2 then return n else write level 0 >> hang)
        `shouldReturn` 3
    it "fails or faults when its condition does" $ do
      logging (\note -> monitor failing (note "r") (note "t")) `shouldReturn` (failure, [])
      logging (\note -> monitor faulting (note "r") (note "t")) `shouldReturn` (fault, [])
 where
  one = 1 :: Int
  two = 2 :: Int
  failing = failWith "blind" :: Behavior Bool
  failure = FailedWith (show (FailedBecause "blind"))
  faulting = throwing :: Behavior Bool
  fault = FaultedWith (show (Fault "broken"))
  gaveUp = FailedWith (show Failed) :: Ending ()

throwing :: Behavior a
throwing = throw (Fault "broken")

write :: TVar a -> a -> Behavior ()
write variable = atomically . writeTVar variable

-- | How a behaviour ends that writes to a log, and the log.
logging :: ((String -> Behavior ()) -> Behavior a) -> IO (Ending a, [String])
logging behavior = do
  logged <- newTVarIO []
  end <- ending (behavior (\what -> atomically (modifyTVar' logged (what :))))
  entries <- readTVarIO logged
  return (end, reverse entries)
