-- | An exception that is itself undefined is thrown from outside, while a cleanup faults.
-- Expected: the fault is thrown, inside an asynchronous exception.
module UndefinedOutside (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (replicateM_)

import Attack
import Behavior

attack :: IO ()
attack = replicateM_ 100 $ do
  entered <- newEmptyMVar
  end <- endsWithin 3000 "undefined" (\t -> takeMVar entered >> throwTo t (error "undefined" :: Boom)) $
    parallel ((putMVar entered () >> milliseconds 3600000) `finally` throwIO (Boom 1)) (milliseconds 3600000)
  case end of
    Left e -> do
      what <- try (evaluate (fromException e)) :: IO (Either SomeException (Maybe StoppedWithFault))
      case what of
        Right (Just (StoppedWithFault _ fault)) -> promise (show fault) (fromException fault == Just (Boom 1))
        Right Nothing -> broken ("the fault is lost: " ++ show e)
        Left e' -> broken ("the fault is lost: what is thrown is undefined: " ++ show e')
    Right () -> broken "returned"
