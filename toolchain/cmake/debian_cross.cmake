# What the toolchain files of Debian's ARM Linux targets share. They set leadline_triplet, leadline_emulator and
# CMAKE_SYSTEM_PROCESSOR.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_C_COMPILER ${leadline_triplet}-gcc)
set(CMAKE_CXX_COMPILER ${leadline_triplet}-g++)
set(CMAKE_LIBRARY_ARCHITECTURE ${leadline_triplet})
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES LEADLINE_SYSROOT)

set(LEADLINE_SYSROOT "" CACHE PATH "Unpacked packages of the target (toolchain/sysroot.sh), or nothing")
if(LEADLINE_SYSROOT)
  if(NOT IS_DIRECTORY ${LEADLINE_SYSROOT}/usr/lib/${leadline_triplet})
    message(FATAL_ERROR "No libraries of ${leadline_triplet} in ${LEADLINE_SYSROOT}: toolchain/setup.sh --cross")
  endif()
  set(CMAKE_SYSROOT ${LEADLINE_SYSROOT})
  set(ENV{PKG_CONFIG_LIBDIR}
    ${CMAKE_SYSROOT}/usr/lib/${leadline_triplet}/pkgconfig:${CMAKE_SYSROOT}/usr/share/pkgconfig)
  set(ENV{PKG_CONFIG_SYSROOT_DIR} ${CMAKE_SYSROOT})
  set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
  set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
  set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
  set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
  # The loader and the C library of one and the same place: with those of the cross compiler's package and these
  # mixed, threads never start.
  set(CMAKE_CROSSCOMPILING_EMULATOR ${leadline_emulator} -L ${CMAKE_SYSROOT})
else()
  set(CMAKE_CROSSCOMPILING_EMULATOR ${leadline_emulator})
  string(APPEND CMAKE_EXE_LINKER_FLAGS_INIT " -static")
endif()
