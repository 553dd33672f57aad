#include "gpu_bake_run.h"
