# shellcheck shell=bash
# Sourced by the scripts here. Chooses what builds the package; installs what is
# missing from Debian, where that is possible.
#
#   the first of these that is found        BEHAVIOR_TOOLCHAIN  dependencies
#   ------------------------------------    ------------------  -------------------
#   cabal, GHC and an index of Hackage      cabal               from Hackage
#   cabal, GHC and the libraries below      cabal-offline       those installed
#   stack, GHC and the libraries below      stack-offline       those installed
#   stack, and it reaches its snapshot      stack               from the snapshot
#   Debian's apt-get, as root               (install, then the first line again)
#   none of them                            (one line that says what to install)
#
# "GHC" is GHC 9.0 or later. Set BEHAVIOR_TOOLCHAIN to choose another one. The user's
# configuration of cabal and stack is not changed.

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# cabal, GHC and the programs read and write UTF-8, whatever the locale is.
[ "$(locale charmap 2>/dev/null)" = UTF-8 ] || export LC_ALL=C.UTF-8

# The libraries that GHC does not include, each with its Debian package.
libraries=(
  aeson:libghc-aeson-dev
  ansi-terminal:libghc-ansi-terminal-dev
  async:libghc-async-dev
  base64-bytestring:libghc-base64-bytestring-dev
  clock:libghc-clock-dev
  file-embed:libghc-file-embed-dev
  HsOpenSSL:libghc-hsopenssl-dev
  hspec:libghc-hspec-dev
  http-types:libghc-http-types-dev
  HUnit:libghc-hunit-dev
  network:libghc-network-dev
  optparse-applicative:libghc-optparse-applicative-dev
  postgresql-simple:libghc-postgresql-simple-dev
  QuickCheck:libghc-quickcheck2-dev
  scientific:libghc-scientific-dev
  svg-builder:libghc-svg-builder-dev
  terminal-size:libghc-terminal-size-dev
  unliftio-core:libghc-unliftio-core-dev
  uuid:libghc-uuid-dev
  wai:libghc-wai-dev
  wai-websockets:libghc-wai-websockets-dev
  warp:libghc-warp-dev
  websockets:libghc-websockets-dev
)
debian_packages=(ghc cabal-install "${libraries[@]#*:}")

die() {
  echo "$*" >&2
  exit 1
}

# --- what is found ----------------------------------------------------------

has() {
  command -v "$1" >/dev/null
}

has_ghc() {
  has ghc && has ghc-pkg && [ "$(ghc --numeric-version | cut -d. -f1)" -ge 9 ]
}

has_libraries() {
  local installed library
  installed=" $(ghc-pkg list --global --simple-output 2>/dev/null)"
  for library in "${libraries[@]%%:*}"; do
    [[ $installed == *" $library-"[0-9]* ]] || return 1
  done
}

# cabal keeps an index for each repository, in a folder that its configuration
# may name.
has_index() {
  local root=${CABAL_DIR:-${HOME:-}/.cabal} named cache
  named=$(sed -n 's/^ *remote-repo-cache: *//p' "${CABAL_CONFIG:-$root/config}" 2>/dev/null || true)
  for cache in "$named" "$root/packages" "${XDG_CACHE_HOME:-${HOME:-}/.cache}/cabal/packages"; do
    if compgen -G "$cache/*/01-index.*" >/dev/null; then return; fi
  done
  return 1
}

has_snapshot() {
  run_stack build --test --dry-run </dev/null >/dev/null 2>&1
}

choose() {
  if has cabal && has_ghc && has_index; then BEHAVIOR_TOOLCHAIN=cabal
  elif has cabal && has_ghc && has_libraries; then BEHAVIOR_TOOLCHAIN=cabal-offline
  elif has stack && has_ghc && has_libraries; then BEHAVIOR_TOOLCHAIN=stack-offline
  elif has stack && BEHAVIOR_TOOLCHAIN=stack has_snapshot; then BEHAVIOR_TOOLCHAIN=stack
  else return 1
  fi
}

# Chooses once: the scripts that this one calls inherit the choice.
find_toolchain() {
  [ -z "${BEHAVIOR_TOOLCHAIN:-}" ] || return 0
  choose || { install "${debian_packages[@]}" && choose; } || die \
    "Nothing to build with: install GHC (9.0 or later) and cabal and run 'cabal update'; or stack; or," \
    "on Debian 12 or later, as root: apt-get install ${debian_packages[*]}"
  export BEHAVIOR_TOOLCHAIN
}

# --- installing -------------------------------------------------------------

apt_get() {
  DEBIAN_FRONTEND=noninteractive apt-get -qq -y --no-install-recommends \
    -o DPkg::Lock::Timeout=300 -o Acquire::Retries=3 "$@" </dev/null
}

# install PACKAGE...: installs those of the Debian packages that are missing. Fails
# where that is impossible: not Debian, not root, or no network.
install() {
  local package missing=() log
  has apt-get && [ "$(id -u)" = 0 ] || return 1
  for package; do
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] ||
      missing+=("$package")
  done
  if [ ${#missing[@]} -gt 0 ]; then
    echo "Installing from Debian: ${missing[*]}" >&2
    log=$(mktemp)
    # The package lists are updated only when installing with the present ones fails.
    if ! {
      apt_get install "${missing[@]}" || { apt_get update && apt_get install "${missing[@]}"; }
    } >"$log" 2>&1; then
      tail -n 5 "$log" >&2
      rm -f "$log"
      return 1
    fi
    rm -f "$log"
  fi
  # Another GHC may come first in PATH; the libraries belong to this one.
  export PATH="/usr/bin:$PATH"
}

# need PROGRAM...: installs the programs. Their Debian packages have the same names.
need() {
  local program
  for program; do
    has "$program" || install "$program" ||
      die "$program is missing: install it (on Debian, as root: apt-get install $program)"
  done
}

# --- alone ------------------------------------------------------------------

# apart COMMAND...: runs what measures milliseconds. What .ci/run runs beside it (APART: a file) is stopped meanwhile:
# it would not take the processors, but it may hold what the system locks.
apart() {
  local status=0
  if [ -n "${APART:-}" ]; then
    touch "$APART"
    until [ -e "$APART.stopped" ]; do sleep 0.1; done
  fi
  "$@" || status=$?
  [ -z "${APART:-}" ] || rm -f "$APART"
  return $status
}

# --- building ---------------------------------------------------------------

# Without an index cabal fails before it has looked for installed packages; the index
# of an empty repository is enough. Its path must be absolute, and without spaces.
# (Nothing here loads a library dynamically, so none is compiled for that, too; and GHC
# needs less time with a larger nursery.)
run_cabal() {
  local dir=dist-newstyle/offline url
  if [ "$BEHAVIOR_TOOLCHAIN" = cabal ]; then
    cabal "$@"
    return
  fi
  case $PWD in
    *[!A-Za-z0-9/._-]*) url=file+noindex:$dir/packages ;;
    *) url=file+noindex://$PWD/$dir/packages ;;
  esac
  mkdir -p $dir/packages
  printf '%s\n' 'repository empty' "  url: $url" 'active-repositories: :none' \
    'jobs: $ncpus' 'shared: False' 'executable-dynamic: False' \
    'program-default-options' '  ghc-options: -j2 +RTS -A64m -n2m -RTS' >$dir/config.$BASHPID
  mv $dir/config.$BASHPID $dir/config # (Another one may read it.)
  env -u CABAL_CONFIG CABAL_DIR="$PWD/$dir" cabal "$@"
}

run_stack() {
  local options=(--allow-different-user)
  if [ "$BEHAVIOR_TOOLCHAIN" = stack-offline ]; then
    options+=(--system-ghc --resolver "ghc-$(ghc --numeric-version)")
  fi
  stack "${options[@]}" "$@"
}

# build KIND:NAME...: the output of the tools goes to stderr.
build() {
  local targets
  find_toolchain
  case $BEHAVIOR_TOOLCHAIN in
    cabal*) run_cabal build --enable-tests "$@" ;;
    stack*)
      targets=("${@/#/behavior-lang:}")
      # (Stack has one name for the library of a package.)
      run_stack build --test --no-run-tests "${targets[@]/%:lib:behavior-lang/:lib}"
      ;;
  esac >&2
}

# with_packages COMMAND...: runs the command where GHC finds this package's libraries, once they
# are built, and those that they and the tests need.
with_packages() {
  case $BEHAVIOR_TOOLCHAIN in
    cabal*) run_cabal exec -v0 --enable-tests -- "$@" ;;
    stack*) run_stack exec -- "$@" ;;
  esac
}

# build_libraries: all libraries of this package, and what the tests need.
build_libraries() {
  find_toolchain
  case $BEHAVIOR_TOOLCHAIN in
    cabal*) run_cabal build --enable-tests --only-dependencies all >&2 ;;
    stack*) run_stack build --test --only-dependencies >&2 ;;
  esac
  build $(library_names)
}

# stanza NAME: the lines of this common stanza of the package description.
stanza() {
  sed -n "/^common $1\$/,/^\$/p" behavior-lang.cabal
}

# The libraries of this package, as targets.
library_names() {
  awk '/^library/ { print "lib:" (NF > 1 ? $2 : "behavior-lang") }' behavior-lang.cabal
}

# The folders of the libraries, as options of GHC.
library_folders() {
  awk '/^library/ { on = 1 } on && /hs-source-dirs:/ { print "-i" $2; on = 0 }' behavior-lang.cabal
}

# The folders of the tests, and of the examples that they compile, as options of GHC.
test_folders() {
  for name in tests world viewing tool; do stanza $name; done |
    awk '/hs-source-dirs:/ { on = 1; sub(/.*:/, "") } /:/ { on = 0 } on { for (i = 1; i <= NF; i++) print "-i" $i }'
}

# binary KIND:NAME: prints the path of the built program.
binary() {
  case $BEHAVIOR_TOOLCHAIN in
    cabal*) run_cabal list-bin --enable-tests "$1" ;;
    stack*) echo "$(run_stack path --dist-dir)/build/${1#*:}/${1#*:}" ;;
  esac
}

# --- copying ----------------------------------------------------------------

# The files of the working tree, committed or not, as an archive.
sources() {
  git -c safe.directory="$PWD" ls-files -co --exclude-standard -z | while IFS= read -r -d '' file; do
    [ ! -e "$file" ] || printf '%s\0' "$file"
  done | tar --null -T - -c
}

# --- mutants of what is judged ----------------------------------------------

# try_mutants NAME ROWS INSTALLED...: applies each small mistake of test/NAME/mutants.tsv (only those of the rows, if
# there are some) to a copy of this checkout, in which .ci/NAME must detect it by its row. What is installed is linked.
try_mutants() {
  local name=$1 rows=$2 built=$PWD/dist-newstyle/$1 row file change what verdict status=0
  mutated=$(mktemp -d)
  trap 'rm -rf "$mutated"' EXIT
  sources | tar -x -C "$mutated"
  mkdir -p "$built" "$mutated/dist-newstyle/$name"
  for file in "${@:3}"; do ln -s "$built/$file" "$mutated/dist-newstyle/$name/"; done
  while IFS=$'\t' read -r row file change what; do
    [ -z "$rows" ] || [[ " $rows " == *" $row "* ]] || continue
    cp "$file" "$mutated/$file"
    sed -i "$change" "$mutated/$file"
    ! cmp -s "$file" "$mutated/$file" || die "test/$name/mutants.tsv: $what: it changes nothing in $file"
    verdict=detected
    if (cd "$mutated" && ".ci/$name" "$row" </dev/null) >"$built/mutant" 2>&1; then
      verdict=SURVIVED status=1
    elif ! grep -q ': FAILED$' "$built/mutant"; then
      verdict='NOT TRIED (it does not compile, or nothing was judged)' status=1
    fi
    echo "row $row: $what: $verdict"
    cp "$file" "$mutated/$file"
  done < <(grep -v '^#' "test/$name/mutants.tsv")
  return $status
}
