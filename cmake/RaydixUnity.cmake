# Sources whose headers cost more than their own code are compiled several at a time: as one file that includes them.
# Hot loops are compiled alone, so that what the optimiser allows itself in a file is spent on them.
option(RAYDIX_UNITY "Compile sources of programs, documents and tests several at a time: a full build is faster" ON)

# All sources of a target, `batch` at a time.
function(raydix_unity target batch)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ${RAYDIX_UNITY} UNITY_BUILD_BATCH_SIZE ${batch})
endfunction()

# Sources of a target, `batch` at a time. Those that a preset leaves out (RAYDIX_SKIP) are counted too: a file meets the
# same others in every preset.
function(raydix_unity_in_order target batch)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ${RAYDIX_UNITY} UNITY_BUILD_MODE GROUP)
    set(count 0)
    foreach(source ${ARGN})
        math(EXPR group "${count} / ${batch}")
        set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${group})
        math(EXPR count "${count} + 1")
    endforeach()
endfunction()

# Those of raydix_sources that the regular expression finds, as one.
function(raydix_unity_group name expression)
    set(group ${raydix_sources})
    list(FILTER group INCLUDE REGEX "${expression}")
    set_source_files_properties(${group} PROPERTIES UNITY_GROUP ${name})
endfunction()
