#!/usr/bin/env bash
# Two ranks by hand, made once for the tests of launchers: FOLDER/capture and its run FOLDER/hand.  hand.sh CNERF FOLDER
unset CNERF_HAND
. "$(dirname "$0")/common.sh"
by_hand "$work/hand"
