# vellum_install_if_built(FILE)
# Skips the install rules of this folder that follow where FILE, for which generator expressions serve, was not built:
# `scripts/build run` builds less than everything, and that can be installed, too.
function(vellum_install_if_built FILE)
  install(CODE "if(NOT EXISTS \"${FILE}\")
  message(STATUS \"Not built and not installed: ${FILE}\")
  return()
endif()")
endfunction()
