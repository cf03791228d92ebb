#!/bin/sh
# Builds the programs and tells what they do; each command and its whole output go to target/demo/log.txt. Called by `make demo`.
set -eu
export LC_ALL=C
cd "$(dirname "$0")/.."
biflag=target/release/biflag out=target/demo log=target/demo/log.txt last=target/demo/last
rm -rf $out
mkdir -p $out
exec 3>&1
# Removes the line of progress, which only a terminal has.
clear=
[ ! -t 1 ] || clear='\r\033[K'
say() { printf "$clear%s\n" "$1"; }
stop() { say "${1}Every command and its whole output: $log"; exit "$2"; }
trap 'stop "Stopped. " 130' INT
# Runs a command; its output is in $last. Exit code 3: done with warnings.
run() {
    printf '\n%s $ %s\n' "$(date +%T)" "$*" >> $log
    { code=0; "$@" 2>&1 || code=$?; echo "exit code $code"; } | {
        trap '' INT
        while IFS= read -r line; do
            printf '%s\n' "$line" >> $log
            printf '%s\n' "$line"
            [ -z "$clear" ] || printf "$clear  %.70s" "$line" >&3
        done
    } > $last
    code=$(sed -n '$s/^exit code //p' $last)
    case $code in
        0 | 3) ;;
        *) say "This command failed: $*"; tail -n 12 $last; stop '' "${code:-1}" ;;
    esac
}
# Prints a label, and the numbers that sed finds in the last output, in a format.
row() {
    value=$(sed -n "s/.*$2/p" $last | head -n 1)
    [ -n "$value" ] || stop "There is no '$1' in the output of the last command. " 1
    say "$(printf "       %-40s $3" "$1" $value)"
}
# Compares the session with the model of a robot on a page; prints the model's yaws from the JSON.
compare() {
    run $biflag compare $out/robot --robot "$1" -o "$2" --json
    for trial in '001_w1+50_w2+10 (50, 10)' '002_w1-90_w2+90 (-90, 90)'; do
        row "yaw at ${trial#* } rpm, in the model" "${trial%% *}.mcap\"[^{]*{[^{]*\"steady_modelled_deg\":\[\([^,]*\),[^{]*\"steady_yaw_error_deg\":\([^,]*\),.*/\1 \2" \
            '%8.2f deg, off by %.2f deg'
    done
}

say 'Building the programs and the firmware; some minutes at first.'
run make --no-print-directory build

say '1/5  A real sensor was turned by hand; the firmware reads its counts (biflag record --virtual=COUNTS.csv)'
run $biflag record host/plans/hand-turn-z.toml --virtual=tests/data/mpu6050/rotate-z-720.csv --out $out/hand-turn
row 'turned by hand about z' 'turned [^ ]* of \([0-9.]*\)° about z.*/\1' '%8s deg'
row 'read by the firmware' 'turned \([^ ]*\) of.*/\1' '%8s deg'
row "error that the sensor's maker allows" "within the sensor's ±\([^ ]*\) %.*/\1" '%8s %%'

say '2/5  The sensor of the emulated board has such errors too, and is measured once (biflag sensor)'
run $biflag sensor poses --seconds 5 --virtual -o $out/sensor.toml
run $biflag sensor turn z --repeats 1 --virtual -o $out/sensor.toml
row 'error of its scale about z' 'scale of the gyroscope about z: \([^ ]*\) ± \([^ ]*\) %.*/\1 \2' '%8s ± %s %%'

say '3/5  The board drives a simulated robot in glycerin, and two trials are recorded (biflag record --virtual)'
cp host/plans/robot-hidden.toml $out
sed 's/^robot = .*/&\nsensor = "sensor.toml"/; s/^run = 50/run = 40/' host/plans/demo.toml > $out/demo.toml
run $biflag record $out/demo.toml --virtual --out $out/robot
for trial in '001_w1+50_w2+10 (50, 10)' '002_w1-90_w2+90 (-90, 90)'; do
    row "yaw at ${trial#* } rpm" "${trial%% *}  *\([^ ]*\) ± \([^ ]*\) .*/\1 \2" '%8s ± %s deg'
    row 'pitch' "${trial%% *}  *[^ ]* ± [^ ]*  *\([^ ]*\) ± \([^ ]*\) .*/\1 \2" '%8s ± %s deg'
    row 'frames lost' "${trial%% *}: .* \([0-9]*\) lost,.*/\1" '%8s'
done

say '4/5  The viscosity and the tether of that robot are hidden. The default robot disagrees (biflag compare)'
compare physical $out/robot/compare-before.html
say '     A fit of the first trial looks for what is hidden (biflag calibrate)'
run $biflag calibrate $out/robot/001_w1+50_w2+10.mcap --robot physical --fit viscosity,tether -o $out/fitted.toml
row 'viscosity, fitted' 'viscosity  *[^ ]*  *\([^ ]*\)  *\([^ ]*\) to  *\([^ ]*\) .*/\1 \2 \3' '%8s Pa s (95 %%: %s to %s)'
row 'tether, fitted' 'tether  *[^ ]*  *\([^ ]*\)  *\([^ ]*\) to  *\([^ ]*\) .*/\1 \2 \3' '%8s N m/rad (95 %%: %s to %s)'
cp $out/robot-hidden.toml $last
row 'viscosity, hidden' 'viscosity_pa_s = \([^ ]*\).*/\1' '%8s Pa s'
row 'tether, hidden' 'tether_full_nm_per_rad = \([^ ]*\).*/\1' '%8s N m/rad'
say '     What the fitted robot leaves, also in the second trial, which the fit has not seen (biflag compare)'
compare $out/fitted.toml $out/robot/compare.html

say '5/5  Soft flagella bundle, and unwrap when motor 2 reverses after 35 s (biflag simulate)'
run $biflag simulate host/plans/bundling.toml --shapes --out $out/bundling
row 'bundled from' 'bundled from \([^ ]*\) s.*/\1' '%8s s'
row 'until' 'bundled from [^ ]* s, [a-z]* from \([^ ]*\) s.*/\1' '%8s s'
run $biflag report $out/bundling
rm $last
say "Open in a browser: $out/robot/compare.html (the result), $out/robot/compare-before.html, $out/bundling/report.html"
say 'Foxglove, Rerun and PlotJuggler open the logs (*.mcap) beside them.'
stop '' 0
