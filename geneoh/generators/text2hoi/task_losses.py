"""The loss of each network of Text2HOI on a batch of samples."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.generators.text2hoi.condition import Condition
from geneoh.generators.text2hoi.config import Text2HoiConfig
from geneoh.generators.text2hoi.contact import ContactNetwork, contact_loss
from geneoh.generators.text2hoi.interaction import InteractionNetwork
from geneoh.generators.text2hoi.losses import geometric_loss, simple_loss
from geneoh.generators.text2hoi.refiner import RefinerNetwork, points_of
from geneoh.generators.text2hoi.refiner_losses import refiner_loss
from geneoh.generators.text2hoi.samples import Samples
from geneoh.generators.text2hoi.tokens import Tokens, actions_of, tokens_of
from geneoh.synthesis.draws import Draws


def contact_task_loss(
    network: ContactNetwork, samples: Samples, config: Text2HoiConfig, draws: Draws
) -> Float[Tensor, ""]:
    """The loss of the contact network."""
    return contact_loss(
        network,
        samples.objects,
        samples.touched,
        samples.text,
        divergence=config.divergence,
        noise=draws.normal(network.config.latent).to(samples.text),
    )


@dataclass(frozen=True)
class Answer:
    """One answer of the interaction network to clips with noise."""

    clean: Tokens
    guess: Tokens
    squared: Float[Tensor, ""]  # the simple loss
    sigma: Float[Tensor, " B"]  # of the noise


def answer_to_noise(
    network: InteractionNetwork, samples: Samples, config: Text2HoiConfig, draws: Draws
) -> Answer:
    """What the network makes of the samples at random levels of noise, in one pass."""
    tokens = tokens_of(samples.actions, network.config.frame)
    condition = Condition(
        samples.text,
        samples.objects,
        samples.contact,
        tokens.present,
        tokens.valid,
        ~draws.chance(config.text_dropout).to(tokens.present.device),
        ~draws.chance(config.object_dropout).to(tokens.present.device),
    )
    level = draws.integers(1, len(network.sigmas)).to(tokens.present.device)
    clean = network.normalise(tokens.flat) * tokens.defined
    noise = draws.normal(*clean.shape[1:]).to(clean)
    sigma = network.sigmas[level]
    x = clean + sigma[:, None, None] * noise
    found = network.denoised(x, level.float(), network.encode(condition))
    guess = tokens.with_flat(network.denormalise(found))
    return Answer(tokens, guess, simple_loss(found, clean, tokens.defined), sigma)


def interaction_loss(
    network: InteractionNetwork, samples: Samples, config: Text2HoiConfig, draws: Draws
) -> Float[Tensor, ""]:
    """The loss of the interaction network at random levels of noise."""
    answer = answer_to_noise(network, samples, config, draws)
    sigma = answer.sigma
    share = 1 / (1 + sigma.square()) if config.losses.sharp else torch.ones_like(sigma)
    actions, touched = samples.actions, samples.touched
    return answer.squared + geometric_loss(
        answer.guess, answer.clean, actions, touched, config.losses, draws, share
    )


def refiner_task_loss(
    interaction: InteractionNetwork,
    network: RefinerNetwork,
    samples: Samples,
    config: Text2HoiConfig,
    draws: Draws,
) -> Float[Tensor, ""]:
    """The loss of the refiner on what one pass of the interaction network makes of clips.

    Source: Text2HOI, section 3.5 and its code. The object is where the interaction network puts it.
    """
    interaction = interaction.to(samples.text.device)
    with torch.no_grad():
        guess = answer_to_noise(interaction, samples, config, draws).guess
        made = actions_of(guess, samples.actions)
    coarse, clean = (tokens_of(a, network.config.frame) for a in (made, samples.actions))
    points, contact, normals = points_of(made, coarse, samples.contact, network.config.points)
    found = network(coarse, points, contact)
    return refiner_loss(found, coarse, clean, points, normals, config.refining)
