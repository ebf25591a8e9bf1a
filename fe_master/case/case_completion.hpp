#pragma once

#include "case.hpp"
#include "case_mistakes.hpp"

namespace femxdem {

/// Gives the parameters whose default depends on others, or on the purpose, their values; `mistakes` knows which keys
/// the file has.
void complete_case(Case& c, Purpose purpose, const Mistakes& mistakes);

}  // namespace femxdem
