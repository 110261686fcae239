-- |
-- Files that are gone after an example.
module Temporary
  ( inFolder
  , withPath
  ) where

import Control.Exception (bracket)
import System.Directory (createDirectory, getTemporaryDirectory, removeDirectoryRecursive, removeFile)
import System.FilePath ((</>))
import System.IO (hClose, openTempFile)

-- | With an empty folder.
inFolder :: (FilePath -> IO a) -> IO a
inFolder = bracket create removeDirectoryRecursive
 where
  create = do
    temporary <- getTemporaryDirectory
    (folder, file) <- openTempFile temporary "behavior-lang"
    hClose file
    removeFile folder
    createDirectory folder
    pure folder

-- | With the path of a file that does not exist.
withPath :: (FilePath -> IO a) -> IO a
withPath use = inFolder (use . (</> "file"))
