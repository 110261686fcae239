module Viewer.ViewingSpec (spec) where

import Control.Exception (ErrorCall (..), IOException, bracket, throwIO, try)
import Control.Monad (filterM, forM_, void)
import qualified Data.ByteString as Strict
import qualified Data.ByteString.Lazy as Lazy
import Data.IORef
import Data.List (isInfixOf)
import GHC.IO.Handle (hDuplicate, hDuplicateTo)
import System.Directory (doesPathExist, getSymbolicLinkTarget, listDirectory)
import System.IO
import System.Posix.Files (createNamedPipe, ownerModes)
import System.Posix.IO (closeFd)
import Test.Hspec

import Behavior.Time (sleep)
import Behavior.Trace
import Behavior.Trace.File
import Behavior.Trace.Viewing
import Temporary
import Viewer.Examples

spec :: Spec
spec = do
  it "writes both files" . withPath $ \path -> do
    viewing (toFiles path) (named "drive" (pure ())) `shouldReturn` ()
    Right (_, events, Nothing) <- parseTrace . Lazy.fromStrict <$> Strict.readFile path
    length events `shouldBe` 2
    drawn <- readFile (path ++ ".svg")
    drawn `shouldSatisfy` isInfixOf "drive"
  forM_ [("created", "/no/such/folder/file"), ("written", "/dev/full")] $ \(what, path) ->
    describe ("with a file that cannot be " ++ what) $
      forM_ [("the trace", trace path), ("the timeline", picture path)] $ \(which, view) -> do
      it (which ++ ": runs the behaviour, then throws what names the file") $ do
        ran <- newIORef False
        (result, printed) <- printedOnStderr (try (viewing view (named "drive" (writeIORef ran True))))
        (result, printed) `shouldSatisfy` isProblem path
        readIORef ran `shouldReturn` True
      it (which ++ ": throws what the behaviour throws, and reports the file") $ do
        (result, printed) <- printedOnStderr (try (viewing view (named "drive" (throwIO (ErrorCall "lost a wheel")))))
        result `shouldBe` (Left (ErrorCall "lost a wheel") :: Either ErrorCall ())
        map (path `isInfixOf`) (lines printed) `shouldBe` [True]
      it (which ++ " of a run that is over: throws what names the file") $ do
        result <- try (viewEvents view mission)
        (result, "") `shouldSatisfy` isProblem path
  it "names both files, if neither can be written" $ do
    (result, printed) <-
      printedOnStderr (try (viewing (Viewing (Just "/dev/full") (Just "/no/such/folder/file") False) (pure ())))
    map ("/dev/full" `isInfixOf`) (lines printed ++ [either (show :: IOException -> String) show result])
      `shouldSatisfy` or
    map ("/no/such/folder/file" `isInfixOf`) (lines printed ++ [either show show result]) `shouldSatisfy` or
  it "draws the timeline of a run that is over, if its trace cannot be written" . withPath $ \path -> do
    void (try (viewEvents (Viewing (Just "/dev/full") (Just path) False) mission) :: IO (Either IOException ()))
    doesPathExist path `shouldReturn` True
  it "says once that the trace cannot be written any more" . withPath $ \path -> do
    createNamedPipe path ownerModes
    reader <- openBinaryFile path ReadMode
    (result, printed) <- printedOnStderr . try . viewing (trace path) $
      hClose reader >> forM_ [1 .. 3 :: Int] (\n -> named (show n) (sleep 0.03))
    (result, printed) `shouldSatisfy` isProblem path
  it "says that the trace cannot be closed" . withPath $ \path -> do
    result <- try (viewing (trace path) (closeBehindIt path))
    (result, "") `shouldSatisfy` isProblem path
 where
  toFiles path = Viewing (Just path) (Just (path ++ ".svg")) False
  trace path = defaultViewing {traceFile = Just path}
  picture path = defaultViewing {timelineFile = Just path}
  isProblem :: FilePath -> (Either IOException (), String) -> Bool
  isProblem path (result, printed) = either ((path `isInfixOf`) . show) (const False) result && null printed

-- Closes the descriptors of the file, so that its handle cannot be closed.
closeBehindIt :: FilePath -> IO ()
closeBehindIt path = listDirectory folder >>= filterM isOfFile >>= mapM_ (closeFd . read)
 where
  folder = "/proc/self/fd"
  isOfFile n =
    either (const False) (== path)
      <$> (try (getSymbolicLinkTarget (folder ++ "/" ++ n)) :: IO (Either IOException FilePath))

-- What the action returns, and what is written to stderr meanwhile.
printedOnStderr :: IO a -> IO (a, String)
printedOnStderr act = withPath $ \path -> do
  result <- bracket (hDuplicate stderr) (\old -> hDuplicateTo old stderr >> hClose old) $ \_ ->
    withFile path WriteMode (`hDuplicateTo` stderr) >> act
  printed <- readFile path
  length printed `seq` pure (result, printed)
