// SPDX-License-Identifier: BSD-3-Clause
// The main function of programs with the tests of several sources. `--source=FOLDER/NAME.cpp` runs those of one source,
// less those that the filter of gtest excludes; without it the program is as any of gtest.
#include <gtest/gtest.h>

#include <iostream>
#include <string>

namespace {

/// The tests of a source, each as a pattern of gtest's filter with a colon behind it.
std::string patterns_of(const std::string& source) {
  const std::string end = "/" + source;
  const testing::UnitTest& program = *testing::UnitTest::GetInstance();
  std::string patterns;
  for (int i = 0; i < program.total_test_suite_count(); ++i) {
    const testing::TestSuite& suite = *program.GetTestSuite(i);
    for (int j = 0; j < suite.total_test_count(); ++j) {
      const testing::TestInfo& test = *suite.GetTestInfo(j);
      const std::string file = test.file();
      if (file.size() < end.size() || file.compare(file.size() - end.size(), end.size(), end) != 0) continue;
      patterns += std::string(suite.name()) + "." + test.name() + ":";
    }
  }
  return patterns;
}

/// Whether the filter of gtest could be narrowed to the tests of the source.
bool select(const std::string& source) {
  const std::string filter = GTEST_FLAG_GET(filter);
  const std::size_t excluded = filter.find('-');
  const std::string included = filter.substr(0, excluded);
  const std::string patterns = patterns_of(source);
  if (patterns.empty()) std::cerr << "no tests of " << source << std::endl;
  if (!included.empty() && included != "*") {
    std::cerr << "with --source the filter can only exclude tests: -PATTERN" << std::endl;
    return false;
  }
  GTEST_FLAG_SET(filter, excluded == std::string::npos ? patterns : patterns + filter.substr(excluded));
  return !patterns.empty();
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  const std::string option = "--source=";
  if (argc > 1) {
    const std::string argument = argv[1];
    if (argc > 2 || argument.compare(0, option.size(), option) != 0) {
      std::cerr << "usage: " << argv[0] << " [--source=FOLDER/NAME.cpp] [--gtest_...]" << std::endl;
      return 2;
    }
    if (!select(argument.substr(option.size()))) return 2;
  }
  return RUN_ALL_TESTS();
}
