// SPDX-License-Identifier: BSD-3-Clause
// No tests: this program is compiled as tests are, for the headers that they share precompiled.
