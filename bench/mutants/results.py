# SPDX-License-Identifier: Apache-2.0
"""Results: one JSON object a line, appended as they come, so that a run can be stopped and resumed."""
import json
import threading


class Results:
    def __init__(self, path):
        self.path = path
        self.lock = threading.Lock()
        self.records = {}
        if path.exists():
            for line in path.read_text(encoding="utf-8").splitlines():
                record = json.loads(line)
                self.records[record["id"], record["stage"]] = record

    def find(self, name, stage):
        return self.records.get((name, stage))

    def of_stage(self, stage):
        return {name: record for (name, other), record in self.records.items() if other == stage}

    def stages(self):
        return list(dict.fromkeys(stage for _, stage in self.records))

    def add(self, name, stage, **values):
        record = {"id": name, "stage": stage} | values
        with self.lock:
            self.records[name, stage] = record
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(record) + "\n")
        return record
