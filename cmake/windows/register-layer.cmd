@echo off
rem SPDX-License-Identifier: Apache-2.0
rem Lets Vulkan programs of this user find the layer in this folder, so that they can turn it on. /remove undoes that.
setlocal
set "key=HKCU\Software\Khronos\Vulkan\ExplicitLayers"
set "manifest=%~dp0VkLayer_vellum_opacity_micromap.json"
if /i "%~1"=="/remove" (
  reg delete "%key%" /v "%manifest%" /f
) else (
  reg add "%key%" /v "%manifest%" /t REG_DWORD /d 0 /f
)
