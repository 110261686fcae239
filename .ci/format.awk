# Checks the format of files (with LC_ALL=C): no tab, no blank at the end of a line, at most 120 characters in a
# line, and in a Haskell module the imports by name in each group. Prints each place, and what is allowed there.
#
# Longer may be: the row of a table, what an example or a program prints (on a page, what is between ``` and ``` and is
# not Haskell; .ci/signatures prints a page of its own), and a line with a link or a picture.

function wrong(allowed) {
  print FILENAME ":" FNR ": " allowed
  found = 1
}

# (In UTF-8 these are the bytes of a character but its first.)
function characters(line) {
  gsub(/[\200-\277]/, "", line)
  return length(line)
}

FNR == 1 {
  page = FILENAME ~ /\.md$/
  module = FILENAME ~ /\.hs$/
  printed = 0
  block = ""
  before = ""
}

# In a comment, and on a page, an example is a line with >>> or several between :{ and :}, and what it prints are
# the lines after it.
{
  text = $0
  example = 0
  if (sub(/^ *-- ?/, "", text) || page) {
    if (text ~ /^>>>/) {
      example = 1
      printed = text !~ /^>>> :\{/
    } else if (text ~ /^:\}/) printed = 1
    else if (text ~ /^(```)?$/) printed = 0
  } else printed = 0
  if (page && text ~ /^ *```/) block = block == "" ? text : ""
}

characters($0) > 120 && (!printed || example) && (block ~ /^( *```haskell)?$/ || example) &&
  FILENAME !~ /signatures\.md$/ && text !~ /^\|.*\|$|\t.*\t|https?:|^!\[/ {
  wrong("at most 120 characters, but in a table, in what is printed, and with a link; here: " characters($0))
}

/\t/ && FILENAME !~ /(Makefile|\.tsv|\.go|go\.mod)$/ { wrong("no tab, but in a Makefile, in .tsv and in Go") }

/[ \t]$/ { wrong("no blank at the end of a line") }

module && /^import / {
  name = $2 == "qualified" ? $3 : $2
  if (name < before) wrong("imports by name in their group: " name " before " before)
  before = name
}

# A group of imports ends at any other line that is not indented.
!/^(import |[ \t]+[^ \t])/ { before = "" }

END { exit found }
