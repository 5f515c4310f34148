# CMake functions for compiled models and Python extension modules in C, for every package that finds hric_core.
set(Python3_EXECUTABLE ${PYTHON_EXECUTABLE})
find_package(Python3 REQUIRED COMPONENTS Interpreter Development.Module)

# hric_exact_library(TARGET): put the library among the Python packages of the devel and the install space, and make
# its results bit for bit the same in every build: no fused multiply-add, and no optimisation that reorders sums.
function(hric_exact_library TARGET)
  set_target_properties(${TARGET} PROPERTIES C_STANDARD 11 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF C_VISIBILITY_PRESET hidden
    LIBRARY_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/${CATKIN_GLOBAL_PYTHON_DESTINATION})
  target_compile_options(${TARGET} PRIVATE -Wall -Wextra -Wno-missing-field-initializers -O3 -ffp-contract=off)
  target_link_libraries(${TARGET} PRIVATE m)
  install(TARGETS ${TARGET} LIBRARY DESTINATION ${CATKIN_GLOBAL_PYTHON_DESTINATION})
endfunction()

# hric_python_module(NAME SOURCE...): build the Python extension module NAME from C sources.
function(hric_python_module NAME)
  Python3_add_library(${NAME} MODULE WITH_SOABI ${ARGN})
  hric_exact_library(${NAME})
endfunction()
