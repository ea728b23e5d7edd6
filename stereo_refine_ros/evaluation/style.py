# Copyright 2026 stereo_refine_ros contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The style sheet of the HTML reports: light and dark, desktop and phone."""

STYLE = """
:root { color-scheme: light dark; --line: #8884; --good: #00695c; --worse: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --good: #6fd3c1; --worse: #ff9a8f; } }
body { margin: 0; font: 16px/1.5 system-ui, sans-serif; background: Canvas; color: CanvasText; }
main { max-width: 90rem; margin: 0 auto; padding: 1rem; }
p, ul { max-width: 60rem; }
h1 { font-size: 1.5rem; } h2 { margin-top: 2rem; border-bottom: 1px solid var(--line); }
.command { white-space: pre-wrap; overflow-wrap: anywhere; padding: .6rem;
  border: 1px solid var(--line); border-radius: .4rem; font-size: .85rem; }
.scroll { overflow-x: auto; margin-bottom: 1.5rem; }
table { border-collapse: collapse; font-size: .85rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: .4rem 0; }
th, td { padding: .3rem .6rem; border-bottom: 1px solid var(--line); text-align: right;
  white-space: nowrap; vertical-align: top; }
th:first-child { position: sticky; left: 0; background: Canvas; text-align: left; }
.good { color: var(--good); } .worse { color: var(--worse); } .same { font-weight: 400; }
.legend { display: flex; flex-wrap: wrap; gap: .3rem 1.5rem; font-size: .85rem; }
.bar { display: inline-block; width: 8rem; height: .8rem; vertical-align: middle;
  background-origin: border-box;
  border: 1px solid var(--line); }
summary { cursor: pointer; padding: .4rem 0; font-weight: 600; }
.pictures { display: grid; gap: .5rem;
  grid-template-columns: repeat(auto-fill, minmax(min(100%, 11.5rem), 1fr)); }
figure { margin: 0; } figure img { width: 100%; height: auto; display: block; }
figcaption { font-size: .8rem; }
@media (max-width: 40rem) { .pictures { grid-template-columns: 1fr 1fr; } }
"""
