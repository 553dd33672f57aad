#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Bakes the files of a list as a job array of Slurm. Each task bakes its part, and a task that starts again after its node
# has failed skips what is done.
# usage: sbatch --array=1-64 examples/slurm/bake.sh LIST FOLDER
#   LIST      a file with the name of a model in each line, seen by all nodes
#   FOLDER    where to write the models, and FOLDER.logs with a log of each task
#SBATCH --job-name=vellum-bake --requeue --open-mode=append --output=/dev/null
set -eu
logs=$2.logs
mkdir -p "$logs"
log=$logs/$SLURM_ARRAY_TASK_ID.jsonl
exec vellum bake --files "$1" -o "$2" --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT" \
  --threads "${SLURM_CPUS_ON_NODE:-0}" --log "$log" --resume "$log" >>"$logs/$SLURM_ARRAY_TASK_ID.txt" 2>&1
