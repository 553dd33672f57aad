# Warnings that every target of ours is compiled with. Link `vellum_warnings` privately.
add_library(vellum_warnings INTERFACE)
target_compile_options(vellum_warnings INTERFACE
  -Wall -Wextra -Werror -Wshadow -Wconversion -Wsign-conversion -Wold-style-cast -Wnon-virtual-dtor -Wimplicit-fallthrough
  # `{VK_STRUCTURE_TYPE_...}` leaves the rest of a Vulkan structure zero on purpose.
  -Wno-missing-field-initializers)
