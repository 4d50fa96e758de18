# 32-bit ARM Linux (ARMv7 with hardware floating point), as Debian's armhf. With LEADLINE_SYSROOT (toolchain/sysroot.sh
# armhf) libraries come from there; without it only what needs none can be built (LEADLINE_PARTS=replay), linked
# statically.
set(leadline_triplet arm-linux-gnueabihf)
set(CMAKE_SYSTEM_PROCESSOR armv7l)
set(leadline_debian_architecture armhf)
# GCC's remark that a convention changed in its version 7 is about mixing objects with older ones.
set(CMAKE_CXX_FLAGS_INIT -Wno-psabi)
set(leadline_emulator qemu-arm-static)
include(${CMAKE_CURRENT_LIST_DIR}/debian_cross.cmake)
