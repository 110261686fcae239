{-# LANGUAGE OverloadedStrings #-}

-- |
-- The colours and the fonts of a timeline, by the classes of its elements.
module Behavior.Trace.Svg.Style
  ( style
  ) where

import Data.Text (Text)
import qualified Data.Text as Text

-- | The style sheet. The colours of the dark variant replace those of the light one.
style :: Text
style =
  Text.concat
    [ ".bt text{font:12px system-ui,-apple-system,'Segoe UI',Roboto,'DejaVu Sans',sans-serif}"
    , ".bt .t{font-size:18px;font-weight:600}.bt .tr{font-size:14px;font-weight:400}"
    , ".bt .b{stroke-width:1}.bt .m{stroke:none}.bt .ar{fill:none;stroke-width:1.6;stroke-linejoin:round}"
    , ".bt .ha{fill:none;stroke-width:4.5;opacity:.85}.bt .thin .ar{stroke-width:.8;opacity:.7}"
    , ".bt .r{stroke-dasharray:4 3}.bt .e{text-anchor:end}.bt .c{text-anchor:middle}"
    , ".bt .l text,.bt .il text{paint-order:stroke;stroke-width:3px;stroke-linejoin:round}"
    , ".bt .k{font-weight:600}.bt .n{font-size:11px}.bt .z{font-size:10px}.bt .io{stroke-width:1.8}"
    , colours
        [ "#fcfcfa", "#e7e7e2", "#23262b", "#666b73", "#d3e6dd", "#7fb09c", "#f9d9c9", "#d4622a", "#f2bda2"
        , "#f4c0d0", "#8c1d4b", "#c7527f", "#e4def6", "#8468cc", "#dfeaf7", "#5088c0", "#5a2fc2"
        ]
    , "@media(prefers-color-scheme:dark){"
    , colours
        [ "#15171b", "#2a2d33", "#e8e8e4", "#9ba1ab", "#24443a", "#4f8a76", "#57301d", "#f08a55", "#7a452a"
        , "#571b35", "#f283ab", "#95325d", "#372d5e", "#a58df0", "#1d3450", "#6aa5e0", "#c3aeff"
        ]
    , "}"
    ]
 where
  colours
    [ ground, grid, ink, muted, ok, okEdge, bad, badEdge, badHatch
    , fault, faultEdge, faultHatch, stop, stopEdge, run, runEdge, arrow
    ] =
    Text.concat
      [ rule ".g" "fill" ground
      , rule ".gl" "stroke" grid
      , rule "text" "fill" ink
      , rule ".q" "fill" muted
      , ".bt .s{fill:" <> ok <> ";stroke:" <> okEdge <> "}"
      , ".bt .a{fill:url(#bt-a);stroke:" <> okEdge <> ";stroke-dasharray:5 2}"
      , ".bt .f{fill:url(#bt-f);stroke:" <> badEdge <> "}"
      , ".bt .x{fill:url(#bt-x);stroke:" <> faultEdge <> "}"
      , ".bt .p{fill:" <> stop <> ";stroke:" <> stopEdge <> "}"
      , ".bt .r{fill:" <> run <> ";stroke:" <> runEdge <> "}"
      , ".bt .h{fill:url(#bt-s);stroke:none}.bt .v2{opacity:.55}"
      , rule ".m.s" "fill" okEdge
      , rule ".m.a" "fill" okEdge
      , rule ".m.f" "fill" badEdge
      , rule ".m.x" "fill" faultEdge
      , rule ".m.p" "fill" stopEdge
      , rule ".m.r" "fill" runEdge
      , rule ".ahb" "fill" ground
      , rule ".ah" "stroke" ok
      , rule ".fhb" "fill" bad
      , rule ".fh" "stroke" badHatch
      , rule ".xhb" "fill" fault
      , rule ".xh" "stroke" faultHatch
      , rule ".shb" "fill" stop
      , rule ".sh" "stroke" stopEdge
      , rule ".ar" "stroke" arrow
      , rule ".ha" "stroke" ground
      , rule ".i" "fill" arrow
      , ".bt .io{fill:" <> ground <> ";stroke:" <> arrow <> "}"
      , rule ".ld" "stroke" muted
      , ".bt .wt{stroke:" <> muted <> ";stroke-dasharray:1 5;stroke-width:2;stroke-linecap:round}"
      , rule ".l text,.bt .il text" "stroke" ground
      , rule ".l .os" "stroke" ok
      , rule ".l .oa" "stroke" ground
      , rule ".l .of" "stroke" bad
      , rule ".l .ox" "stroke" fault
      , rule ".l .op" "stroke" stop
      , rule ".l .or" "stroke" run
      , rule ".w,.bt .nf" "fill" badEdge
      , rule ".nx" "fill" faultEdge
      ]
  colours _ = ""
  rule selector property colour = Text.concat [".bt ", selector, "{", property, ":", colour, "}"]
