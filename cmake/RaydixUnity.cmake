# Sources whose headers cost more than their own code are compiled several at a time: as one file that includes them.
# Hot loops are compiled alone, so that what the optimiser allows itself in a file is spent on them.
option(RAYDIX_UNITY "Compile sources of programs and documents several at a time: a full build is faster" ON)

# All sources of a target, `batch` at a time.
function(raydix_unity target batch)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ${RAYDIX_UNITY} UNITY_BUILD_BATCH_SIZE ${batch})
endfunction()

# Those of raydix_sources that the regular expression finds, as one.
function(raydix_unity_group name expression)
    set(group ${raydix_sources})
    list(FILTER group INCLUDE REGEX "${expression}")
    set_source_files_properties(${group} PROPERTIES UNITY_GROUP ${name})
endfunction()
