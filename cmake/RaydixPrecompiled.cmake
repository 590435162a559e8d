# raydix_precompile(TARGET <header>...): headers of other libraries, compiled once for all sources of a target.
# A precompiled header holds paths and times of its checkout. So that a compiler cache finds what comes after it in another
# checkout too, it is told a sum of what the headers say (ccache: pch_external_checksum, set in scripts/ccache_settings).
function(raydix_precompile target)
    target_precompile_headers(${target} PRIVATE ${ARGN})
    if(NOT RAYDIX_CCACHE)
        return()
    endif()
    set(folder ${CMAKE_CURRENT_BINARY_DIR}/CMakeFiles/${target}.dir)
    list(TRANSFORM ARGN PREPEND "#include " OUTPUT_VARIABLE lines)
    list(JOIN lines "\n" lines)
    file(CONFIGURE OUTPUT ${folder}/precompiled_headers.h CONTENT "${lines}\n")
    execute_process(COMMAND ${CMAKE_CXX_COMPILER} -std=c++20 -E -P -dD -x c++ ${folder}/precompiled_headers.h
        RESULT_VARIABLE failed OUTPUT_VARIABLE text ERROR_QUIET)
    set(ending gch)
    if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
        set(ending pch)
    endif()
    if(failed)  # a header outside the compiler's own folders: the cache then reads the precompiled header itself
        file(REMOVE ${folder}/cmake_pch.hxx.${ending}.sum)
    else()
        string(SHA256 sum "${text}")
        file(CONFIGURE OUTPUT ${folder}/cmake_pch.hxx.${ending}.sum CONTENT "${sum}\n")
    endif()
endfunction()
