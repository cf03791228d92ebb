#!/bin/sh
# Builds the pages of the gallery in target/gallery, each with the commands that made it. Called by `make gallery`.
set -eu
cd "$(dirname "$0")/.."
bin=$PWD/target/release
out=target/gallery
rm -rf "$out"
mkdir -p "$out"
cd "$out"
cat > viscosity.toml <<'PLAN'
[session]
name = "viscosity"

[vary]
"fluid.viscosity_pa_s" = [0.8, 1.0, 1.25]

[trial]
method = "steady"

[speeds]
grid = { w1 = [-90, 90, 30], w2 = [0, 90, 18] }
PLAN
# Runs a command and keeps it for the list. Exit code 3: done with warnings, which are on the page.
run() {
    shown="biflag $*"
    echo "$shown" >&2
    "$bin/biflag" "$@" > /dev/null || [ $? = 3 ]
    commands="$commands$shown
"
}
# Adds a page to the list, with the commands since the last one.
page() {
    printf '<li><a href="%s">%s</a><p>%s</p><pre>%s</pre></li>\n' "$1" "$2" "$3" "$commands" >> list
    commands=
}
commands=
: > list

run simulate bundling --shapes --out bundling
run report bundling
run film bundling/*.mcap --time 5,45 -o bundling.gif
run figure contact bundling 1 -o contact.svg
page bundling/report.html "Two flagella wind round each other" \
    'Soft flagella that turn the same way bundle, and unwind when motor 2 reverses. Also as <a href="bundling.gif">a film</a> and <a href="contact.svg">a figure</a>.'

run record demo --virtual --out recording
run compare recording --robot physical
page recording/compare.html "A recording disagrees with the model" \
    "The real firmware on the emulated board; the viscosity and the tether of the robot behind it are hidden."

run calibrate recording --robot physical --fit viscosity,tether -o fitted.toml
run compare recording --robot fitted.toml -o fitted.html
page fitted.html "A fit finds what was hidden" "The same recording beside the model with the fitted viscosity and tether."

run simulate published-map --method steady --out map
run report map
run figure map map -o map.svg
page map/report.html "The map of the publication" \
    'Steady yaw, pitch, roll and tilt at 190 pairs of speeds. Also as <a href="map.svg">a figure</a>.'

run sweep viscosity.toml --out viscosity
run report viscosity -o viscosity.html
run figure lines viscosity --value yaw_deg --over w1_rpm --by fluid_viscosity_pa_s --at w2_rpm=36 -o viscosity.svg
page viscosity.html "A sweep over speeds and viscosity" \
    'Any result over any two inputs. Also as <a href="viscosity.svg">a figure</a>; the plan is <a href="viscosity.toml">viscosity.toml</a>.'

run steer --yaw 40 --pitch 3 --model --for 120 --out steered
run report steered
page steered/report.html "An attitude is reached and held" "A yaw of 40° and a pitch of 3° in the model, by a controller that follows the means over each beat."

cat > index.html <<HTML
<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>Biflag: gallery</title>
<style>:root { color-scheme: light dark } body { max-width: 46rem; margin: 2rem auto; padding: 0 1rem; font: 16px/1.5 system-ui, sans-serif }
li { margin-bottom: 1.6rem } pre { overflow-x: auto; font-size: .85rem; padding: .6rem; border: 1px solid #8886; border-radius: 6px } img { max-width: 100% }</style></head>
<body><h1>Gallery</h1><p>Pages as Biflag writes them, each with the commands that made it.</p>
<p><img src="bundling.gif" alt="Two flagella wind round each other"></p><ol>
$(cat list)
</ol></body></html>
HTML
rm list
echo "open $out/index.html"
