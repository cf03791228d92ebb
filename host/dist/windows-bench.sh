# The second part of host/dist/windows-test.sh, which reads this file: biflag.exe at a bench, with emulated boards behind COM ports.
mkfifo control idle
exec 3<> control 4<> idle

# Starts an emulated board with these options, which reads commands from a file; the file `$2` has its answers. Sets `port`.
board() {
    commands=$1
    answers=$2
    shift 2
    rm -f "$answers"
    "$root/target/release/vnano" "$@" < "$commands" > "$answers" 3<&- 4<&- &
    until grep -qs '"event":"ready"' "$answers"; do sleep 0.1; done
    pty=$(sed -n 's/.*"port":"\([^"]*\)".*/\1/p' "$answers")
    port=COM$((${pty#/dev/pts/} + 10))
}

# Starts a recording in the background: its session, and the other arguments.
recording() {
    out=$1
    shift
    wine "$exe" record plan.toml --port "$port" --out "$out" "$@" > recorded 2>&1 &
    recorder=$!
}

until_it_says() {
    until grep -q "$1" recorded; do
        sleep 0.1
        kill -0 $recorder 2> /dev/null || { cat recorded; exit 1; }
    done
}

# The recording must end with this exit code, and no motor may be driven so many seconds later.
ends_at_rest() {
    code=0
    wait $recorder || code=$?
    sleep "$3"
    echo status >&3
    sleep 0.3
    if [ $code != "$1" ] || ! tail -n 1 board | grep -q '"pwm":\[0,0\]'; then
        cat recorded
        tail -n 1 board
        exit 1
    fi
    echo "ok ($1): $2"
}

# As Notepad writes it. The name is not one of a folder here.
printf '\357\273\277[session]\r\nname = "a:b"\r\n[trial]\r\nrest_at_most = 0\r\ncalibrate = 1\r\npreroll = 2\r\nrun = 6\r\n' > plan.toml
printf 'decay = 2\r\n[speeds]\r\npairs = [[50, 10], [0, 45], [-50, 10]]\r\n' >> plan.toml
board control board --firmware "$root/target/firmware.elf" --robot physical
expect 0 settings --new --port "$port"

# In a terminal: a note is typed, then Ctrl-C. On a busy computer the line is read late.
mkfifo typed
script -qec "wine '$exe' record plan.toml --port $port --out noted" recorded < typed > /dev/null &
recorder=$!
exec 5> typed
until [ -e noted/001_w1+50_w2+10.mcap ]; do sleep 0.1; done
sleep 1
printf 'n stirred\r' >&5
sleep 4
printf '\003' >&5
ends_at_rest 130 "a note and Ctrl-C in a terminal" 0
exec 5>&-
expect 3 info noted/001_w1+50_w2+10.mcap
says "stirred"

# Ctrl-C, Ctrl-Break (1) and a console that closes (2) stop the motors; a kill leaves that to the board.
recording rec
until_it_says '001.*: run$'
expect 3 info rec
says "being recorded"
expect 3 report rec
expect 1 record plan.toml --port "$port" --out rec --resume
says "busy"
until_it_says '002.*: run$'
kill -INT $recorder
ends_at_rest 130 "Ctrl-C" 0
grep -q "interrupted, the motors are stopped" recorded
for event in 1 2; do
    recording rec --resume
    until_it_says '002.*: run$'
    wine "$helper" event $event
    ends_at_rest 130 "event $event of the console" 0
done
recording rec --resume
until_it_says '002.*: run$'
kill -KILL $recorder
ends_at_rest 137 "killed" 0.6
expect 3 record plan.toml --port "$port" --out rec --resume
expect 3 info rec
says "3 of 3 trials complete"
says " 0 lost, 0 CRC errors"
expect 3 film rec/001_w1+50_w2+10.mcap --width 120 --speed 8 -o film.gif
expect 3 steer --yaw=-67 --pitch=-4 --port "$port" --rest 0 --for 5 --out steered --policy "\"Z:$helper\" steer"

# avrdude: none, in the places where it is found, and one that works, with a board that has no firmware.
ide="$WINEPREFIX/drive_c/users/$(id -un)/AppData/Local/Arduino15/packages/arduino"
rm -rf "$ide"
expect 1 flash --port "$port"
says "winget install"
for folder in "$ide/tools/avrdude/8.0/bin" "$scratch/tools" "${exe%/*}"; do
    mkdir -p "$folder"
    cp "$helper" "$folder/avrdude.exe"
    WINEPATH="$scratch/tools" expect 0 flash --port "$port"
    says "runs firmware"
done
cat avrdude.txt
grep -c . avrdude.txt | grep -qx 3
expect 0 doctor --port "$port"
grep -q "other programs" output && exit 1
expect 0 doctor --motors --yes --port "$port"
expect 0 sensor still 30 --port "$port" -o sensor.toml
printf 'ff+\n2b\nok\n' > keys
expect 0 align --port "$port" < keys
board idle new --bootloader old
AVRDUDE_SCRIPT="$root/host/dist/windows-avrdude.sh" expect 0 flash --port "$port"
says "written at 57600 bit/s to m328p"
rm -r "$ide"
exec 3>&-

# A path that is longer than programs of Windows usually can have, names that are none of folders, and files in use.
part=$(printf '%0110d' 0 | sed 's/0/ü/g')
deep="tief/$part/$part"
mkdir -p "$deep"
sed 's/a:b/con/; s/preroll = 2/preroll = 0/; s/run = 6/run = 2/; s/, \[0, 45.*/]/' plan.toml > "$deep/plan.toml"
board idle other --firmware "$root/target/firmware.elf" --robot physical
expect 0 settings --new --port "$port"
expect 3 record "$deep/plan.toml" --port "$port" --out "$deep/rec"
expect 3 report "$deep/rec"
expect 3 export "$deep/rec"
$biflag info "$deep/rec" > by-linux || [ $? = 3 ]
expect 3 info "$deep/rec"
cmp by-linux output
expect 3 simulate "$deep/plan.toml"
expect 3 simulate plan.toml
[ -d session-con ] && [ -d a-b ]
# Has a file open as soon as it is there, for so many milliseconds.
hold() {
    wine "$helper" hold "$1" "$2" &
    holder=$!
    sleep 1
}
hold 'held\001_w1+50_w2+10.mcap.unfinished' 1000
expect 3 simulate --speeds=50,10 --duration 20 --out held
hold 'late\001_w1+50_w2+10.mcap.unfinished' 4000
expect 1 simulate --speeds=50,10 --duration 20 --out late
cat output
wait $holder
expect 3 simulate --speeds=50,10 --duration 20 --out late --resume

# Trials of 20 s in real time on four boards at once, and those that this computer's biflag records from equal boards.
recorders=
for number in 1 2 3 4; do
    awk -v number=$number -v trials="${TRIALS:-4}" 'BEGIN {
        split("50 10 0 45 -50 10 30 -20 -60 -20", rpm)
        print "[session]\nname = \"angles\"\n[trial]\nrest_at_most = 0\ncalibrate = 1\npreroll = 10\nrun = 20\ndecay = 20\n[speeds]\npairs = ["
        for (i = number - 1; i < trials; i += 4) {
            j = int(i / 4) % 5
            print "[" rpm[2 * j + 1] * (1.2 - number / 10) ", " rpm[2 * j + 2] * (1.2 - number / 10) "],"
        }
        print "]"
    }' > angles$number.toml
    board idle angles --firmware "$root/target/firmware.elf" --robot physical
    expect 0 settings --new --port "$port"
    wine "$helper" run code$number "$exe" record angles$number.toml --port "$port" --out wine-$number > recorded$number 2>&1 &
    recorders="$recorders $!"
done
for number in 1 2 3 4; do
    board idle angles --firmware "$root/target/firmware.elf" --robot physical --speed max --patience 60
    fast=$!
    $biflag settings --new --port "$pty" > /dev/null
    $biflag record angles$number.toml --port "$pty" --out linux-$number > recorded 2>&1 || [ $? = 3 ]
    # A fast board would use a core until the end.
    kill $fast
done
for recorder in $recorders; do
    wait "$recorder" || true
done
cat code1 code2 code3 code4 | grep -qxE '[03]{4}'
for number in 1 2 3 4; do
    for system in wine linux; do
        $biflag info $system-$number --json > $system-$number.json || [ $? = 3 ]
    done
done
python3 "$root/host/dist/windows-angles.py"

# Kills at any time, as on Linux.
export BIFLAG_PROGRAM="$root/host/dist/windows-biflag.sh" BIFLAG_EXE="$exe" BIFLAG_HELPER="$helper"
cd "$root"
KILLS=${KILLS:-3} cargo test --release --locked -p tests --test all interruption::killed -- --nocapture
