#!/bin/sh
# A program that answers as gphoto2 does, for the camera that is described by the files beside it (see studio.rs).
here=$(dirname "$0")
echo "$*" >> "$here/log"
pwd >> "$here/places"
while [ $# -gt 0 ]; do
  case $1 in
    --auto-detect)
      cat "$here/cameras" ;;
    --port)
      if [ -e "$here/claimed" ]; then cat "$here/claimed" >&2; exit 1; fi
      grep -q " $2" "$here/cameras" || { echo "*** Error: no camera at port $2" >&2; exit 1; }
      shift ;;
    --list-config)
      for setting in "$here"/settings/*; do echo "/main/some/${setting##*/}"; done ;;
    --get-config)
      setting=$here/settings/$2
      if [ -e "$setting/garbage" ]; then cat "$setting/garbage"; else
        echo "Label: $2"
        if [ -e "$setting/fixed" ]; then echo "Readonly: 1"; else echo "Readonly: 0"; fi
        echo "Type: RADIO"
        echo "Current: $(cat "$setting/current")"
        number=0
        while read -r choice; do echo "Choice: $number $choice"; number=$((number + 1)); done < "$setting/choices"
        echo "END"
      fi
      shift ;;
    --set-config-value)
      setting=$here/settings/${2%%=*}
      grep -qxF "${2#*=}" "$setting/choices" || { echo "*** Error: Bad parameters" >&2; exit 1; }
      [ -e "$setting/stubborn" ] || echo "${2#*=}" > "$setting/current"
      shift ;;
    --filename)
      name=$2
      shift ;;
    --force-overwrite) ;;
    --capture-image-and-download)
      if [ -e "$here/hangs" ]; then echo $$ > "$here/pid"; exec sleep 600; fi
      if [ -e "$here/fails" ]; then cat "$here/fails" >&2; exit 1; fi
      # Whoever plays the scene waits for this, and leaves what is seen now in `taken`.
      if [ -e "$here/looks" ]; then echo > "$here/looks"; read -r _ < "$here/seen"; fi
      for file in "$here"/taken/*; do
        cp "$file" "${name%%.*}.${file##*.}"
        echo "Saving file as ${name%%.*}.${file##*.}"
      done ;;
    *)
      echo "gphoto2: unknown option $1" >&2
      exit 1 ;;
  esac
  shift
done
