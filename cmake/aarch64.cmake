# Toolchain of preset aarch64: Debian's cross compiler, libraries from the sysroot that scripts/aarch64 unpacks,
# programs run under qemu.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)

# Headers and libraries of other packages only: libc and libstdc++ are the cross compiler's own.
set(raydix_sysroot ${CMAKE_CURRENT_LIST_DIR}/../build/aarch64-sysroot)
cmake_path(ABSOLUTE_PATH raydix_sysroot NORMALIZE)
set(raydix_sysroot_lib ${raydix_sysroot}/usr/lib/aarch64-linux-gnu)
set(CMAKE_FIND_ROOT_PATH ${raydix_sysroot} /usr/aarch64-linux-gnu)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(ENV{PKG_CONFIG_LIBDIR} ${raydix_sysroot_lib}/pkgconfig:${raydix_sysroot}/usr/share/pkgconfig)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${raydix_sysroot})
set(CMAKE_EXE_LINKER_FLAGS_INIT "-Wl,-rpath-link,${raydix_sysroot_lib}")

find_program(raydix_qemu NAMES qemu-aarch64-static qemu-aarch64 REQUIRED)
set(CMAKE_CROSSCOMPILING_EMULATOR "${raydix_qemu};-L;/usr/aarch64-linux-gnu;-E;LD_LIBRARY_PATH=${raydix_sysroot_lib}")
