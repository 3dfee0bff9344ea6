// SPDX-License-Identifier: GPL-3.0-or-later
#include <iostream>

#include "tools/author/recipe_markdown.h"
#include "tools/author/recipe_schema.h"
#include "tools/author/settings.h"
#include "tools/cli/verb.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

void printSettings() {
  Settings defaults;
  for (const auto& d : Settings::declarations(defaults)) {
    std::cout << d.key << " = " << valueText(defaults, d) << "   (" << legalText(d);
    if (!d.unit.empty()) std::cout << ", " << d.unit;
    std::cout << ")\n    " << d.sentence << "\n";
  }
}

}  // namespace

void addHelpVerb(CLI::App& app, int& exit_code) {
  struct Command {
    std::string topic;
    bool markdown = false;
  };
  auto command = std::make_shared<Command>();
  CLI::App* verb = app.add_subcommand("help", "Help on a verb, or: help settings, help recipe, help schema");
  verb->add_option("topic", command->topic,
                   "A verb, settings, recipe (its format) or schema (of the recipe, for editors)");
  verb->add_flag("--markdown", command->markdown, "With settings or recipe: as docs/ has it");
  verb->callback([command, &app, &exit_code] {
    exit_code = int(ExitCode::done);
    if (command->topic == "settings") {
      if (command->markdown)
        std::cout << settingsMarkdown();
      else
        printSettings();
    } else if (command->topic == "recipe") {
      std::cout << recipeMarkdown();
    } else if (command->topic == "schema") {
      std::cout << recipeSchema().dump(1) << "\n";
    } else if (command->topic.empty()) {
      std::cout << app.help();
    } else {
      const auto verbs =
          app.get_subcommands([&](const CLI::App* verb_app) { return verb_app->check_name(command->topic); });
      if (verbs.empty()) {
        throw ToolError(ExitCode::usage, "", "there is no verb '" + command->topic + "'", "All verbs: sinew --help.");
      }
      std::cout << verbs.front()->help();
    }
  });
}

}  // namespace sinew::tools
