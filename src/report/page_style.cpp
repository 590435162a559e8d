// How the page looks: light, dark, on paper, on a phone. Series colours are told apart with the
// common kinds of colour blindness; each also has a dash or a marker of its own.
#include "report/page.h"

namespace raydix::report {

std::string_view page_style() {
    return R"css(:root{color-scheme:light dark;
--bg:#fff;--panel:#f6f7f9;--text:#1b1f24;--soft:#57606a;--line:#d8dde3;--grid:#e6e9ed;
--link:#0b5cad;
--good:#005f8a;--good-bg:#dff1fb;--bad:#9a3b00;--bad-bg:#fdeadb;--sim:#6b4c00;--sim-bg:#fff3cf;
--sim-line:#d9a400;
--heat:#5aa9d6;
--c0:#0072b2;--c1:#d55e00;--c2:#009e73;--c3:#c2649a;--c4:#b88600;--c5:#3f9fd8;--c6:#6a51a3;
--c7:#7a7f87}
@media screen and (prefers-color-scheme:dark){:root{
--bg:#14171b;--panel:#1c2026;--text:#e4e7eb;--soft:#a3acb6;--line:#363d46;--grid:#2a3038;
--link:#7cc0ff;
--good:#8fd3ff;--good-bg:#12344a;--bad:#ffb27d;--bad-bg:#4a2810;--sim:#ffdf8a;--sim-bg:#40330b;
--sim-line:#a88412;
--heat:#2d7fae;
--c0:#4ea6e6;--c1:#ff8c4a;--c2:#2cc79a;--c3:#e79bc4;--c4:#f0bd45;--c5:#9ad4f7;--c6:#b6a6f2;
--c7:#a6acb4}}
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%;text-size-adjust:100%;scroll-padding-top:3.5rem}
body{margin:0;background:var(--bg);color:var(--text);
font:16px/1.55 system-ui,-apple-system,"Segoe UI",Roboto,"Noto Sans","Liberation Sans",
"DejaVu Sans",sans-serif;
font-variant-numeric:tabular-nums}
a{color:var(--link);text-decoration:none}
a:hover{text-decoration:underline}
header,main,footer{max-width:72rem;margin:0 auto;padding:0 1.25rem}
header{padding-top:2.2rem}
h1{font-size:1.9rem;line-height:1.2;margin:0 0 .35rem;letter-spacing:-.015em;
overflow-wrap:anywhere}
h2{font-size:1.35rem;line-height:1.3;margin:0 0 .9rem;letter-spacing:-.01em}
h4{font-size:.98rem;margin:1.6rem 0 .3rem}
h3{font-size:1.05rem;line-height:1.35;margin:2rem 0 .6rem;overflow-wrap:anywhere}
p{margin:.5rem 0;max-width:46rem}
.lead,.note,.subtitle,.unit,small,footer{color:var(--soft)}
.lead{margin:0}
.note{font-size:.85rem}
nav{position:sticky;top:0;z-index:3;background:var(--bg);border-bottom:1px solid var(--line);
margin-top:1.2rem}
nav ul{max-width:72rem;margin:0 auto;padding:.55rem 1.25rem;display:flex;gap:1.35rem;
list-style:none;
overflow-x:auto;white-space:nowrap;font-size:.92rem}
section{padding:2.2rem 0 1.4rem;border-bottom:1px solid var(--line)}
section:last-child{border-bottom:0}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(11.5rem,1fr));gap:.8rem;
margin:0 0 1.3rem;padding:0;list-style:none}
.tiles li{background:var(--panel);border:1px solid var(--line);border-radius:.6rem;
padding:.75rem .9rem .8rem;overflow-wrap:anywhere}
.tiles b{display:block;font-size:1.55rem;line-height:1.25;font-weight:650;letter-spacing:-.01em}
.tiles b small{font-size:.9rem;font-weight:400}
.tiles span.what{display:block;font-size:.86rem;line-height:1.4;color:var(--soft);
margin-bottom:.35rem}
#summary h3{margin:1.3rem 0 .2rem;font-size:.95rem;color:var(--soft)}
.said{padding-left:1.15rem;margin:.4rem 0;max-width:52rem}
.said li{margin:.45rem 0;overflow-wrap:anywhere}
.badge{display:inline-block;font-size:.7rem;line-height:1.5;font-weight:600;padding:0 .45em;
border-radius:.6em;
vertical-align:.1em;white-space:nowrap;border:1px solid var(--line);color:var(--soft)}
.badge.measured{color:var(--good);border-color:currentColor}
.badge.simulated{color:var(--sim);background:var(--sim-bg);border:1px dashed var(--sim-line)}
.plots{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,26rem),1fr));
gap:1.6rem 2rem;align-items:start;margin:1rem 0}
figure{margin:0;min-width:0}
figcaption{margin-bottom:.4rem;line-height:1.4}
figcaption .title{font-weight:600}
.subtitle{display:block;font-size:.85rem;overflow-wrap:anywhere}
.legend{list-style:none;display:flex;flex-wrap:wrap;gap:.15rem .95rem;margin:.25rem 0 .5rem;
padding:0;font-size:.8rem;color:var(--soft)}
.legend li{display:flex;align-items:center;gap:.4rem}
.legend svg{width:26px;height:12px;flex:none}
svg{display:block;width:100%;height:auto;overflow:visible}
figure>svg{max-width:33rem}
.c0{--c:var(--c0)}.c1{--c:var(--c1)}.c2{--c:var(--c2)}.c3{--c:var(--c3)}
.c4{--c:var(--c4)}.c5{--c:var(--c5)}.c6{--c:var(--c6)}.c7{--c:var(--c7)}
svg text{font-size:12px;fill:var(--text);font-family:inherit}
svg .axis,svg .label{fill:var(--soft)}
line.grid{stroke:var(--grid);stroke-width:1}
.baseline{stroke:var(--soft);stroke-width:1}
.reference{stroke:var(--soft);stroke-width:1;stroke-dasharray:2 3}
.stroke{stroke:var(--c);stroke-width:2;fill:none;stroke-linejoin:round}
.d1{stroke-dasharray:6 3}.d2{stroke-dasharray:2 3}.d3{stroke-dasharray:9 3 2 3}
.mark{fill:var(--c);stroke:var(--bg);stroke-width:1}
.mark.open{stroke:var(--c);stroke-width:2;fill:none}
.mark.ring{stroke:var(--c);stroke-width:2;fill:var(--bg)}
.fill{fill:var(--c)}
.outline{fill:var(--c);fill-opacity:.32;stroke:var(--c);stroke-width:1.2}
.limit{fill:none;stroke:var(--text);stroke-width:1;stroke-dasharray:3 2}
.whisker{stroke:var(--text);stroke-width:1.2}
.mark-line{stroke:var(--text);stroke-width:2}
.hit{fill:transparent}
g:hover>.fill,g:hover>.outline{filter:brightness(1.15)}
.table{overflow-x:auto;margin:1.1rem 0 .4rem;border:1px solid var(--line);border-radius:.5rem}
table{border-collapse:collapse;width:100%;font-size:.88rem;line-height:1.4}
caption{caption-side:top;text-align:left;font-weight:600;font-size:.95rem;
padding:.6rem .75rem .5rem}
th,td{padding:.36rem .75rem;border-top:1px solid var(--line);vertical-align:baseline;
background:var(--bg)}
thead th{background:var(--panel);font-weight:600;vertical-align:bottom;white-space:nowrap}
thead th.long{white-space:normal;min-width:7rem}
thead .unit{display:block;font-weight:400;font-size:.8rem}
thead .badge{display:block;width:max-content;margin-top:.15rem}
.num{text-align:right;white-space:nowrap}
thead .num .badge{margin-left:auto}
.txt{text-align:left;white-space:nowrap}
.txt.long{white-space:normal;min-width:14rem}
tbody th{font-weight:500}
tbody tr:hover>*{background-image:linear-gradient(rgb(128 128 128/.09),rgb(128 128 128/.09))}
th button{all:unset;cursor:pointer;display:block;width:100%;box-sizing:border-box}
th button:focus-visible,.table:focus-visible{outline:2px solid var(--link);outline-offset:2px}
th button .name::after{content:" \2195";opacity:.35;font-weight:400}
th[aria-sort=ascending] .name::after{content:" \2191";opacity:1}
th[aria-sort=descending] .name::after{content:" \2193";opacity:1}
.shade{background:color-mix(in srgb,var(--heat) calc(var(--shade)*.62),var(--bg))}
.better{color:var(--good);background:var(--good-bg);font-weight:600}
.worse,.alert{color:var(--bad);background:var(--bad-bg);font-weight:600}
.better small,.worse small,.alert small{color:inherit}
.even{color:var(--soft)}
.none{color:var(--soft)}
.swatch{display:inline-block;width:.7em;height:.7em;border-radius:.2em;background:var(--c);
margin-right:.5em}
details{margin:1rem 0}
summary{cursor:pointer;font-weight:600}
.warning{border-left:4px solid var(--bad);background:var(--bad-bg);color:var(--bad);
padding:.5rem .9rem;border-radius:.3rem}
.pictures{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,26rem),1fr));
gap:1.2rem}
.pictures img{display:block;width:100%;height:auto;border-radius:.4rem;background:var(--panel)}
.pictures figcaption{margin:.4rem 0 0;font-size:.86rem;overflow-wrap:anywhere}
footer{padding-top:1.2rem;padding-bottom:2.5rem;font-size:.85rem}
@media (max-width:40rem){header,main,footer{padding-left:1rem;padding-right:1rem}
nav ul{padding-left:1rem;padding-right:1rem}h1{font-size:1.5rem}
th,td{padding:.34rem .55rem}tbody th{position:sticky;left:0;max-width:42vw;white-space:normal}
tbody th.txt.long{min-width:8rem}
.tiles{grid-template-columns:repeat(auto-fit,minmax(9.2rem,1fr));gap:.6rem}.tiles b{
font-size:1.3rem}}
@media print{body{font-size:10pt}nav{display:none}header,main,footer{max-width:none;
padding-left:0;padding-right:0}
section{padding:1rem 0 .6rem;break-inside:auto}h2,h3,caption,figcaption{break-after:avoid}
figure,.tiles li,tr{break-inside:avoid}.table{overflow:visible;border:0}table{font-size:7.5pt}
th,td{padding:.2rem .35rem}thead th{white-space:normal}.plots{grid-template-columns:1fr 1fr;
gap:1rem}
th button .name::after{content:""}a{color:inherit}
*{-webkit-print-color-adjust:exact;print-color-adjust:exact}}
)css";
}

}  // namespace raydix::report
