// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

namespace situation_awareness {

/// SHA-256 (FIPS 180-4) in hexadecimal, lower case. Throws std::runtime_error if OpenSSL does not have it.
std::string sha256(std::string_view content);

}  // namespace situation_awareness
