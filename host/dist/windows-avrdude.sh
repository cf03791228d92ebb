#!/bin/sh
# The avrdude of this computer for biflag.exe under Wine, which calls ports and files by the names of Windows.
rm -f avrdude.code
for word; do
    shift
    case $word in
        COM*) word=$(readlink "$WINEPREFIX/dosdevices/$(echo "$word" | tr A-Z a-z)") ;;
        flash:w:*) word=flash:w:$(winepath -u "$(printf %s "$word" | sed 's/^flash:w://; s/:e$//')"):e ;;
    esac
    set -- "$@" "$word"
done
avrdude "$@"
echo $? > avrdude.new
mv avrdude.new avrdude.code
