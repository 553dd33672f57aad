// SPDX-License-Identifier: Apache-2.0
// What bindings/js/index.js calls, and what it is called for. Numbers that may have 64 bits are doubles.
#pragma once

#include "vellum/vellum.h"

#define VELLUM_EXPORT(name) extern "C" __attribute__((export_name(name)))

// Callbacks of the call that runs. They return other than 0 to cancel it.
extern "C" {
__attribute__((import_module("vellum"), import_name("progress"))) int vellumProgressOfCall(double done, double total);
__attribute__((import_module("vellum"), import_name("cancelled"))) int vellumCancelledOfCall();
}
