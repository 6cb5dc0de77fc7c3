#!/bin/sh
# A program that decodes what the played camera takes: a PGM behind three letters.
here=$(dirname "$0")
for last; do :; done
if [ -e "$here/decoder-hangs" ]; then exec sleep 600; fi
case $1 in
  --beside) tail -c +4 "$last" > "${last%.*}.pgm" ;;
  *) tail -c +4 "$last" ;;
esac
