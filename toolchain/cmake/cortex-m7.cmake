# Cross compiler for bare-metal Cortex-M7 (Debian: gcc-arm-none-eabi, newlib, libstdc++). Presets cortex-m7 and
# stm32h743; what they build: firmware/m7/README.md.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR cortex-m7)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
# No start-up code to link a trial program with.
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)

# int32_t is "long" in this compiler and "int" in every other that we use: overloads and deduced templates
# would differ by target. Both are 32 bits, and no library call of vehicle code names either.
set(leadline_m7 "-mcpu=cortex-m7 -mthumb -mfpu=fpv5-d16 -mfloat-abi=hard")
foreach(type INT32 INT_LEAST32)
  string(REPLACE INT UINT unsigned_type ${type})
  string(APPEND leadline_m7 " -U__${type}_TYPE__ -D__${type}_TYPE__=int")
  string(APPEND leadline_m7 " -U__${unsigned_type}_TYPE__ \"-D__${unsigned_type}_TYPE__=unsigned int\"")
  string(APPEND leadline_m7 " -U__${type}_MAX__ -D__${type}_MAX__=2147483647")
  string(APPEND leadline_m7 " -U__${unsigned_type}_MAX__ -D__${unsigned_type}_MAX__=4294967295U")
endforeach()
set(CMAKE_C_FLAGS_INIT "${leadline_m7} -ffunction-sections -fdata-sections")
# -Wno-psabi: GCC's remark that a convention changed in its version 7 is about mixing objects with older ones.
set(CMAKE_CXX_FLAGS_INIT "${leadline_m7} -ffunction-sections -fdata-sections -Wno-psabi")

set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE BOTH)
